#!/bin/sh
# system_packages.sh PACKAGE...: install Debian packages that are not there yet.
set -eu
missing=
for package in "$@"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing="$missing $package"
done
[ -n "$missing" ] || exit 0
command -v apt-get >/dev/null || {
    echo "this system has no apt-get; install yourself:$missing" >&2
    exit 2
}
sudo=
[ "$(id -u)" -eq 0 ] || sudo=sudo
echo "installing Debian packages:$missing"
$sudo apt-get update -qq
# shellcheck disable=SC2086 # a list of words is what we want
DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends $missing >/dev/null
