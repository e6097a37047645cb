#!/usr/bin/env python3
"""Kills the program at random moments, gives the same command again, and compares every file with a run that was left alone.

    kill_test.py PROGRAM SCRATCH_FOLDER [--moments N] [--seed S] [--jobs simulate,render,track,fit,sweep,recovery]

Each moment takes one of the jobs in turn, starts it in a folder of its own, and after a random part of the time that it
takes sends SIGKILL or (every fourth) SIGINT, up to three times; SIGINT must end it with exit code 4. The last start is
left alone. Then all files must be there with the same bits as in the undisturbed folder, and no temporary ones; but for
what measures the machine and not the skin:
  fit.json            seconds, forward_seconds, history/*/seconds, systematic/*/seconds
  run.json            /timings_s, /resident_MB, /progress/resumed_from_frame and when it began: a resumed run says that it is one;
                      /work, which counts what the last start did, as /timings_s tells how long that took (steps.csv has
                      the work of all steps and is compared)
  report.html, index.html, results.*, variant.json, recovery.*, summary.csv: the same figures (cpu, wall, solve_cpu, peak
                      memory)
  evaluations/*       the log of a fit, which holds the seconds of each run; as many files must be there
Ends with 1 when something differs; prints what.
"""
import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

SCENE = (Path(__file__).parent / "tiny_scene.json").read_text()
CASE = """{
  "scene": "scene.json",
  "settings": ["/skin/layers/skin/poissons_ratio=0.45"],
  "truth": {"settings": ["/colliders/finger/friction/coefficient=0.8"]},
  "render": {"width": 160, "height": 120, "texture_scale": "0.6 mm", "truth_spacing": 8},
  "track": {"max_tracks": 60, "min_distance": 6},
  "fit": {"parameters": [{"address": "/colliders/finger/friction/coefficient", "initial": 0.4, "lower": 0.125}]}
}"""
EXPERIMENT = """{
  "scene": "scene.json", "settings": ["/time/frames=2"],
  "measure": {"line": {"from": [-5, 0, 0], "to": [5, 0, 0], "points": 50}},
  "variants": [{"name": "soft"}, {"name": "firm", "settings": ["/skin/layers/skin/youngs_modulus=60 kPa"]}]
}"""
JOBS = {
    "simulate": ["simulate", "../scene.json", "-o", "out", "--resume", "--set", "/time/frames=8"],
    "render": ["render", "../case.json", "-o", "out"],
    "track": ["track", "../case.json", "-o", "out"],
    "fit": ["fit", "../case.json", "-o", "out"],
    "sweep": ["study", "sweep", "../experiment.json", "-o", "out"],
    "recovery": ["bench", "recovery", "../case.json", "-o", "out", "--draws", "2", "--variants", "noise_x2", "--variant-draws", "1"],
}
NEEDS = {"track": ["footage.avi", "camera.yaml", "truth.json", "truth_motion.bin"],
         "fit": ["footage.avi", "camera.yaml", "truth.json", "truth_motion.bin"]}
TIME_KEYS = re.compile(r"second|timing|_cpu|^cpu$|wall|memory|started|finished|resumed|elapsed|^date|^time_of|^work$|resident|_MB$")
TIME_COLUMNS = re.compile(r"cpu|wall|memory|seconds")
# Durations and memory in pages and texts, "12.3 s", "3 min 05 s", "98 MB", "solve_cpu" columns.
TIME_TEXT = re.compile(r"\d[\d.e+-]*( |&nbsp;)?(CPU s\b|ms\b|s\b|min\b|h\b|MB\b|GB\b)")


def without_times(value):
    if isinstance(value, dict):
        if TIME_COLUMNS.search(str(value.get("name", ""))) and "value" in value:  # a column of variant.json
            return {"name": value["name"]}
        return {k: without_times(v) for k, v in value.items() if not TIME_KEYS.search(k)}
    if isinstance(value, list):
        return [without_times(v) for v in value]
    return value


def comparable(path):
    """The contents without figures of the machine."""
    data = path.read_bytes()
    name = path.name
    if path.suffix == ".json" and name in ("fit.json", "run.json", "variant.json", "sweep.json"):
        return json.dumps(without_times(json.loads(data)), sort_keys=True).encode()
    if name in ("results.csv", "recovery.csv", "summary.csv"):
        rows = [line.split(",") for line in data.decode().splitlines()]
        keep = [k for k, title in enumerate(rows[0]) if not TIME_COLUMNS.search(title)]
        return "\n".join(",".join(row[k] for k in keep if k < len(row)) for row in rows).encode()
    if path.suffix in (".html", ".md"):
        lines = [line for line in data.decode().splitlines() if not re.search(r"solve cpu|peak memory", line)]
        return TIME_TEXT.sub("T", "\n".join(lines)).encode()
    return data


def tree(folder):
    """Relative paths of all files; logs of evaluations by their names alone."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            name = path.relative_to(folder).as_posix()
            found[name] = b"" if name.startswith("evaluations/") else comparable(path)
    return found


def differences(left_alone, killed):
    lines = []
    for name in sorted(set(left_alone) | set(killed)):
        if name not in killed:
            lines.append(f"{name} is missing")
        elif name not in left_alone:
            lines.append(f"{name} is left over")
        elif left_alone[name] != killed[name]:
            a, b = left_alone[name], killed[name]
            at = next((i for i, (x, y) in enumerate(zip(a, b)) if x != y), min(len(a), len(b)))
            lines.append(f"{name} differs at {at}: {a[max(0, at - 60):at + 60]!r} became {b[max(0, at - 60):at + 60]!r}")
    return lines


def wait_for_handler(process):
    """Until the program, which may still be loading its libraries, catches SIGINT, or has ended."""
    while process.poll() is None:
        try:
            caught = re.search(r"^SigCgt:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text(), re.M)
        except OSError:
            return
        if caught and int(caught[1], 16) >> (signal.SIGINT - 1) & 1:
            return
        time.sleep(0.01)


class Killer:
    def __init__(self, program, scratch, seed):
        self.program, self.scratch, self.random = program, scratch, random.Random(seed)
        self.failures = 0
        self.sent = {"KILL": 0, "INT": 0, "too late": 0}

    def fail(self, text):
        print("FAILED:", text, flush=True)
        self.failures += 1

    def start(self, job, folder):
        with open(folder / "log.txt", "a") as log:
            return subprocess.Popen([self.program, *JOBS[job], "--threads", "1"], cwd=folder, stdout=log, stderr=log)

    def prepare(self, job, name):
        folder = self.scratch / name
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "out").mkdir(parents=True)
        for needed in NEEDS.get(job, []):
            shutil.copy(self.scratch / "left_alone_render" / "out" / needed, folder / "out" / needed)
        return folder

    def finish(self, job, folder):
        code = self.start(job, folder).wait()
        if code != 0:
            self.fail(f"{job} in {folder.name}: exit {code}: {(folder / 'log.txt').read_text()[-400:]}")
        return code == 0

    def left_alone(self, job):
        folder = self.prepare(job, "left_alone_" + job)
        begin = time.monotonic()
        if not self.finish(job, folder):
            sys.exit(1)
        return tree(folder / "out"), time.monotonic() - begin

    def moment(self, number, job, expected, seconds):
        folder = self.prepare(job, f"moment_{number}_{job}")
        story = []
        for _ in range(self.random.choice([1, 1, 2, 3])):
            process = self.start(job, folder)
            wait = self.random.uniform(0, 1.05) * seconds
            is_int = self.random.random() < 0.25
            time.sleep(wait)
            if is_int:
                wait_for_handler(process)
            name = "INT" if is_int else "KILL"
            if process.poll() is None:
                process.send_signal(signal.SIGINT if is_int else signal.SIGKILL)
            code = process.wait()
            ended_well = code == 0  # before the signal, or too near the end to notice it
            self.sent["too late" if ended_well else name] += 1
            story.append(f"{name} after {wait:.2f} s" + (" (was over)" if ended_well else ""))
            if is_int and code not in (0, 4):
                self.fail(f"{job}, {story}: SIGINT ended it with {code}: {(folder / 'log.txt').read_text()[-300:]}")
        if self.finish(job, folder):
            found = tree(folder / "out")
            for line in differences(expected, found):
                self.fail(f"moment {number}, {job}, {', '.join(story)}: {line}")
            if not self.failures:
                shutil.rmtree(folder)
        print(f"moment {number}: {job}, {', '.join(story)}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scratch", type=Path)
    parser.add_argument("--moments", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", default=",".join(JOBS))
    options = parser.parse_args()
    scratch = options.scratch.resolve()
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    for name, text in (("scene.json", SCENE), ("case.json", CASE), ("experiment.json", EXPERIMENT)):
        (scratch / name).write_text(text)
    killer = Killer(os.path.abspath(options.program), scratch, options.seed)
    jobs = options.jobs.split(",")
    killer.left_alone("render")
    expected = {job: killer.left_alone(job) for job in jobs}
    # Twice undisturbed is the same: else the comparison would tell nothing of kills.
    for job in jobs:
        folder = killer.prepare(job, "again_" + job)
        if killer.finish(job, folder):
            for line in differences(expected[job][0], tree(folder / "out")):
                killer.fail(f"{job}, twice undisturbed: {line}")
    if killer.failures:
        sys.exit(1)
    for number in range(options.moments):
        job = jobs[number % len(jobs)]
        killer.moment(number, job, *expected[job])
    print(f"{options.moments} moments, signals {killer.sent}, {killer.failures} failures")
    sys.exit(1 if killer.failures else 0)


if __name__ == "__main__":
    main()
