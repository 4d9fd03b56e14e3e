"""The same engine as a scikit-learn estimator: pipeline, cross-validation by frequency, grid search.

python examples/04_scikit_learn.py [folder for the picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from sklearn.model_selection import GridSearchCV, LeaveOneGroupOut, cross_val_score
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer

from sindyjoint import JointRegressor, campaign_states, regression_rows, virtual_campaign

campaign = virtual_campaign(noise=0.02, rng=4)
rows = regression_rows(campaign_states(campaign), campaign.joint.inertia)
every = slice(None, None, 10)  # a tenth of the rows is enough for a picture
X, y, groups = rows.X[every], rows.y[every], rows.groups[every]  # θ and θ̇, transfer moment, frequency

# A sensor mounted the other way round, corrected inside the pipeline, so that validation covers it.
turned = Pipeline(
    [("sign", FunctionTransformer(np.negative)), ("joint", JointRegressor("paper", threshold=0.005))]
)
scores = cross_val_score(turned, -X, y, groups=groups, cv=LeaveOneGroupOut())
print("R² on each frequency left out:", ", ".join(f"{score:.5f}" for score in scores))

grid = {"library": ["paper", "polynomial", "extended"], "threshold": [0.002, 0.007, 0.02, 0.07, 0.2]}
search = GridSearchCV(JointRegressor(), grid, cv=LeaveOneGroupOut(), scoring="neg_root_mean_squared_error")
search.fit(X, y, groups=groups)
print("best:", search.best_params_, "->", ", ".join(search.best_estimator_.selected_))

figure = Figure(figsize=(7, 4), layout="constrained")
axes = figure.subplots()
for library, colour, marker in zip(grid["library"], ("#0072b2", "#009e73", "#d55e00"), "os^", strict=True):
    tried = search.cv_results_["param_library"] == library
    error = -100 * search.cv_results_["mean_test_score"][tried] / np.sqrt(np.mean(y**2))
    axes.loglog(
        grid["threshold"],
        error,
        marker + "-",
        color=colour,
        label=library,
        mfc="none" if marker == "o" else colour,
    )
    axes.lines[-1].set_markersize(11 if marker == "o" else 6)
axes.set(
    xlabel="threshold: least unique share of a term",
    ylabel="held-out error, % of RMS moment",
)
axes.set_yticks([2, 3, 5, 10, 20], ["2", "3", "5", "10", "20"])
axes.set_yticks([], minor=True)
axes.legend(frameon=False, title="library", loc="center left")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "04_scikit_learn.png", dpi=110)
print(f"picture: {folder / '04_scikit_learn.png'}")
