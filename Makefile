# make run: evolve a wall follower; make test: all that CI checks.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed
RUN := runs/de-best-seed-1

.PHONY: run test bench convergence figures clean

run: $(INSTALLED)
	@if [ -f $(RUN)/config.yaml ]; then \
	  $(BIN)/python -m evolution.run --resume $(RUN); \
	else \
	  $(BIN)/python -m evolution.run --output $(RUN); \
	fi

test: $(INSTALLED)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/python -m pytest -q -n 2 --durations=10

bench: $(INSTALLED)
	$(BIN)/python -m benchmarks.throughput --json results/throughput.json

convergence: $(INSTALLED)
	$(BIN)/python -m benchmarks.convergence

# the README's pictures; the first needs EGL or OSMesa
figures: $(INSTALLED) $(RUN)/champion.json
	$(BIN)/python -m epuck_mj.render $(RUN)/champion.json --output docs/champion.png
	cp $(RUN)/fitness.png docs/fitness.png
	cp $(RUN)/trajectory.png docs/trajectory.png

$(RUN)/champion.json:
	$(MAKE) run

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
	  --constraint constraints.txt --editable '.[dev]'
	touch $(INSTALLED)

clean:
	rm -rf .venv .pytest_cache .ruff_cache .hypothesis
