"""A sweep under ReFrame 4, which knows Slurm, Flux, PBS, LSF and others: one test a shard.

    RAYBENCH_SHARDS=8 reframe -c raybench_reframe.py -r -S suite=full -S out=/scratch/sweep

Sanity is the verdict: the run has ended and no structure broke its claim. The performance variables are the medians in
ns per ray. `reframe --restore-session --failed -r ...` runs what failed again, and each goes on where it was.
"""

import csv
import json
import os

import reframe as rfm
import reframe.utility.sanity as sn
from reframe.core.builtins import parameter, run_before, sanity_function, variable

SHARDS = int(os.environ.get("RAYBENCH_SHARDS", "1"))


@rfm.simple_test
class RaybenchShard(rfm.RunOnlyRegressionTest):
    descr = "One shard of a raybench sweep"
    valid_systems = ["*"]
    valid_prog_environs = ["*"]
    exclusive_access = True
    #: The command; the default is found in the path.
    raybench = variable(str, value="raybench")
    #: Name of a suite or path of its file.
    suite = variable(str, value="default")
    #: Folder for the shards' results, seen by all nodes; merged by `raybench merge`.
    out = variable(str)
    shard = parameter(range(1, SHARDS + 1))

    @property
    def folder(self):
        return os.path.join(self.out, str(self.shard))

    @run_before("run")
    def set_command(self):
        self.executable = self.raybench
        self.executable_opts = ["run", "--suite", self.suite, "--shard", f"{self.shard}/{SHARDS}"]
        self.executable_opts += ["--out", self.folder, "--resume", "--no-report"]

    def rows(self):
        with open(os.path.join(self.folder, "cases.csv"), newline="") as file:
            return list(csv.DictReader(file))

    @sanity_function
    def verdict(self):
        with open(os.path.join(self.folder, "run.json")) as file:
            run = json.load(file)
        refused = sorted({row["spec"] for row in self.rows() if row["status"] == "refused"})
        return sn.all(
            [
                sn.assert_true(run["ended"] and not run["interrupted"], "the run has not ended"),
                sn.assert_eq(refused, [], "broke their claims: {0}"),
            ]
        )

    @run_before("performance")
    def set_performance(self):
        timed = [row for row in self.rows() if row["status"] == "timed" and row["query"] != "build"]
        self.perf_variables = {
            f"{row['scene']}/{row['spec']}/{row['ray_set']}/{row['order']}/{row['threads']}": sn.make_performance_function(
                sn.defer(float(row["median_ns"])), "ns"
            )
            for row in timed
        }
