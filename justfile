# Recipes for daily work; `just --list` prints them. scripts/test runs all tests.

# Format, lints and unit tests: under two minutes once everything is built.
quick:
    scripts/lint
    cargo fmt --all --check
    cargo clippy --release --workspace --exclude importers --locked -- -D warnings
    cargo test --release --workspace --exclude importers --lib --locked --quiet

# All tests.
test:
    scripts/test

# Systematic faults; the page in a browser; FMUs for Windows under wine.
test-long:
    scripts/test-long

# Regenerates the generated files: modelDescription/ and the packed FMUs in dist/.
bless:
    cargo run --release --locked -- pack --ssp --update-descriptions

# The benchmarks of the book; they need a machine without other load.
bench:
    .venv/bin/python scripts/bench/benchmark-peers
    cargo bench --package cosim-results --bench results
    cargo bench --package tests

# The page of the pendulum in a browser, tried in Chromium.
web:
    scripts/web --test

# The book, with its links checked.
book:
    scripts/book

# FMUs and commands for every platform.
cross:
    scripts/cross --test

# The Python package, installed into a new environment and tested there.
wheel:
    scripts/wheel --test
