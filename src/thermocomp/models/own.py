"""Table of the modelling methods of this package."""

from thermocomp.models.method import Method

OWN = (
    Method("ols", "least squares on all temperatures", "thermocomp.models.ols:LeastSquares"),
    Method(
        "partial-f",
        "stepwise regression by partial F, 100 to enter and 50 to delete",
        "thermocomp.models.partial_f:PartialF",
    ),
    Method("mra", "Chen's stepwise second-order regression", "thermocomp.models.second_order:SecondOrderRegression"),
    Method(
        "averaged",
        "average of many ridge regressions on lagged temperatures and states of the spindle speed",
        "thermocomp.models.averaged:AveragedDynamic",
        speed="speed",
        takes=("dt", "cycle"),
    ),
    Method(
        "dynamic",
        "ridge regression on temperatures, their lagged copies and the lagged spindle speed",
        "thermocomp.models.dynamic:DynamicRidge",
        speed="speed",
        takes=("dt", "cycle"),
    ),
    Method(
        "grouping",
        "Hwang's correlation grouping and successive regression",
        "thermocomp.models.grouping:CorrelationGrouping",
    ),
    Method(
        "subsets", "exact best subset of the temperatures", "thermocomp.models.subsets:BestSubset", takes=("cycle",)
    ),
    Method("ace", "Wessel's optimal transformations as published, for a few temperatures", "thermocomp.models.ace:ACE"),
    Method(
        "ace-monotone",
        "optimal transformations, with an invertible one of the deviation",
        "thermocomp.models.ace_monotone:MonotoneACE",
    ),
    Method(
        "mlp", "Chen's sigmoid net of 20 hidden nodes, trained by back-propagation", "thermocomp.models.mlp:SigmoidNet"
    ),
    Method("mlp-sklearn", "scikit-learn's net with one hidden layer", "thermocomp.models.mlp_sklearn:SklearnNet"),
    Method(
        "arx",
        "autoregression on the spindle speed alone, orders by final prediction error",
        "thermocomp.models.arx:ARX",
        speed="inputs",
        takes=("dt", "cycle"),
    ),
    Method(
        "arx-free-run",
        "autoregression on the spindle speed alone, fitted in free run, orders by cross-validation",
        "thermocomp.models.arx:ARX",
        speed="inputs",
        takes=("dt", "cycle"),
        settings={"criterion": "free-run", "k_max": 2, "m_max": 2},
    ),
    Method(
        "arx-net",
        "autoregression on the spindle speed alone by a sigmoid net",
        "thermocomp.models.arx_net:NetARX",
        speed="inputs",
        takes=("dt", "cycle"),
    ),
    Method("ridge", "ridge regression on all temperatures", "thermocomp.models.ridge:Ridge", takes=("cycle",)),
    Method(
        "pcr",
        "regression on the first principal components",
        "thermocomp.models.pcr:PrincipalComponents",
        takes=("cycle",),
    ),
    Method(
        "pcr-traversal",
        "principal component regression on the best of all small sets of temperatures",
        "thermocomp.models.pcr_traversal:TraversedComponents",
        takes=("cycle",),
    ),
    Method("sir", "least squares on directions of sliced inverse regression", "thermocomp.models.sir:SlicedInverse"),
    Method("pls", "partial least squares", "thermocomp.models.pls:PartialLeastSquares", takes=("cycle",)),
    Method("lasso", "regression that also selects the temperatures", "thermocomp.models.lasso:Lasso", takes=("cycle",)),
    Method(
        "elastic-net",
        "a lasso that keeps or drops collinear temperatures together",
        "thermocomp.models.lasso:ElasticNet",
        takes=("cycle",),
    ),
    Method("ppr", "projection pursuit regression", "thermocomp.models.ppr:ProjectionPursuit", takes=("cycle",)),
    Method("gp", "Gaussian process; for comparison only, cannot be deployed", "thermocomp.models.gp:GaussianProcess"),
)
