"""Run every benchmark, or the named ones: ``python -m benchmarks table1``."""

import importlib
import pkgutil
import sys

import benchmarks

names = [module.name for module in pkgutil.iter_modules(benchmarks.__path__) if module.name.startswith("bench_")]
wanted = [f"bench_{name}" for name in sys.argv[1:]] or names
for name in wanted:
    if name not in names:
        sys.exit(f"unknown benchmark {name[6:]}; known: {', '.join(n[6:] for n in names)}")
    print(f"== {name[6:]}", flush=True)
    importlib.import_module(f"benchmarks.{name}").main()
