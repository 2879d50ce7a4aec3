# %% [markdown]
# # Tolerances of a process
# A chip made many times, on a Dask cluster: which share of the chips holds a limit, and what decides it. The same study
# runs with `study.run()` in this process, and with Slurm by `metalith study submit`.

# %%
import tempfile
from pathlib import Path

import metalith as ml

root = Path(__file__).resolve().parents[2]

TOLERANCE = f"""
schema = 1
design = "{root}/designs/mini_3x3.toml"
draws = 12

[[vary]]
effect = "cd_bias"          # nm
distribution = "normal"
sd = 3.0

[[vary]]
effect = "defocus"              # um
distribution = "uniform"
low = -6.0
high = 6.0

[[limit]]
figure = "strehl_530nm_0deg"
at_least = 0.6
"""


# %%
def main() -> None:
    # Dask has no types.
    from typing import Any

    import dask.distributed

    dask_distributed: Any = dask.distributed

    folder = Path(tempfile.mkdtemp())
    (folder / "tolerance.toml").write_text(TOLERANCE)
    study = ml.Study(folder / "tolerance.toml", draws_per_shard=4)
    plan = study.plan()
    print(plan["draws"], "draws, shards", study.missing())
    with dask_distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with dask_distributed.Client(cluster) as client:
            study.run(client=client)
    assert study.missing() == []
    result = study.result()
    print(result.yields[-1])
    for response in result.responses:
        print(response["key"], dict(zip([q for q, _ in result.quantities], response["shares"])))
    again = ml.Study(folder / "tolerance.toml", folder / "again.study", draws_per_shard=12)
    again.run()
    # The draws depend neither on the cut nor on who made them.
    assert again.result().draws == result.draws


# %%
if __name__ == "__main__":
    main()
