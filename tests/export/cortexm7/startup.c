/* what comes before main on a Cortex-M7; printf and exit go to the emulator */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
extern uint32_t __stack, __bss_start__, __bss_end__, __data_load, __data_start, __data_end;
extern void initialise_monitor_handles(void);
extern int main(void);
void Reset_Handler(void);
static const struct
{
    uint32_t *stack;
    void (*reset)(void);
    uint32_t others[14];
} vectors __attribute__((section(".vectors"), used)) = {&__stack, Reset_Handler, {0}};
void _init(void) {}
void _fini(void) {}
void Reset_Handler(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* floating point on */
    memcpy(&__data_start, &__data_load, (size_t)((char *)&__data_end - (char *)&__data_start));
    memset(&__bss_start__, 0, (size_t)((char *)&__bss_end__ - (char *)&__bss_start__));
    initialise_monitor_handles();
    exit(main());
}
