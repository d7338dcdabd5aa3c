"""`python -m benchmarks.alignment`: success, errors and time, ours, the published method, and peers."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

METHODS = ("ours", "published", "printed", "clique")
PEERS = ("icp", "plane", "gicp", "fgr", "ransac")


def main() -> None:
    """Each prints tables in Markdown."""
    parser = argparse.ArgumentParser(prog="benchmarks.alignment", description=__doc__)
    parser.add_argument("what", choices=["chablais", "fort-valley", "patches", "stands", "sessions", "poses", "table"])
    parser.add_argument("--data", type=Path, default=Path("../shared/data/forest"))
    parser.add_argument("--first", type=int, default=0, help="perturbation, or made-up pair, to begin with")
    parser.add_argument("--count", type=int, default=100, help="how many")
    parser.add_argument("--methods", nargs="*", choices=(*METHODS, *PEERS), default=METHODS)
    parser.add_argument("--peers", type=Path, help="a Python with open3d and small_gicp, for icp to ransac")
    parser.add_argument("--device", default="cpu", help="of PyTorch, for poses: cpu or cuda")
    parser.add_argument("--log", type=Path, default=Path(tempfile.gettempdir(), "alignment.jsonl"), help="of all parts")
    args = parser.parse_args()
    if set(args.methods) & set(PEERS) and args.peers is None:
        parser.error(f"{', '.join(PEERS)} need --peers")
    if args.what == "poses":
        from benchmarks.alignment import poses

        print(poses.compare(args.device))
        return
    _trials(args)


def _trials(args: argparse.Namespace) -> None:
    from benchmarks.alignment.real_trials import chablais, fort_valley, patches
    from benchmarks.alignment.session_trials import sessions
    from benchmarks.alignment.stand_trials import stands
    from benchmarks.alignment.tables import log, read_log, tables
    from benchmarks.alignment.trials import Asked

    run = {"chablais": chablais, "fort-valley": fort_valley, "patches": patches}
    run |= {"stands": stands, "sessions": sessions}
    if args.what in run:
        with tempfile.TemporaryDirectory() as folder:
            peers = tuple(one for one in args.methods if one in PEERS)
            methods = tuple(one for one in args.methods if one in METHODS)
            asked = Asked(args.data, args.first, args.count, methods, peers, args.peers, Path(folder))
            for one in run[args.what](asked):
                log(args.log, one)
    print(tables(read_log(args.log)))


if __name__ == "__main__":
    main()
