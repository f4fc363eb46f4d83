# The recipes of a working day; scripts/test is the whole test. `just --list` prints them.

features := "tests/fmi,aso-control/lmi"

# Format, lints and unit tests: under two minutes once everything is built.
quick:
    cargo fmt --all --check
    cargo clippy --release --workspace --locked -- -D warnings
    cargo test --release --workspace --lib --locked --quiet

# Everything that proves a claim.
test:
    scripts/test

# Random sequences, corpora, FMUs for Windows under wine.
test-long:
    scripts/test-long

# Regenerates what is generated: modelDescription/ and the packed FMUs in dist/.
bless:
    cargo run --release --locked -- pack --ssp --update-descriptions

# The benchmarks of the book's page on speed; wants a quiet machine.
bench:
    .venv/bin/python scripts/benchmark-peers
    cargo bench --package cosim-master --bench step
    cargo bench --package cosim-results --bench results
    cargo bench --package tests

# The book, with its links checked.
book:
    scripts/book

# FMUs and commands for every platform.
cross:
    scripts/cross --test
