# make run: evolve a wall follower; make test: all that CI checks.
PYTHON ?= python3
BIN := .venv/bin
PROGRAM := .venv/.program
INSTALLED := .venv/.installed
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check \
  --constraint constraints.txt --editable
RUN := runs/de-best-seed-1
LESSON := runs/lesson
# without the notice of mkdocs-material
MKDOCS := NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs
CHAMPION := results/paper/de-best/seed-1
PAPERS := de-best de-rand ga
ROBUST := 1 2 3 4 5 6 7 8 9 10
NETWORKS := robust-feedforward-changes robust-feedforward
FOR_ROBOTS := $(ROBUST:%=results/real-robots/robust/seed-%) \
  $(foreach seed,1 2 3,$(NETWORKS:%=results/real-robots/%/seed-$(seed))) wall-follower

.PHONY: run test docs docs-serve bench ladder convergence racing overhead recording bridge fleet ppo gap results figures clean

run: $(PROGRAM)
	@if [ -f $(RUN)/config.yaml ]; then \
	  $(BIN)/python -m evolution.run --resume $(RUN); \
	else \
	  echo "This takes about 2 minutes on two cores."; \
	  $(BIN)/python -m evolution.run --output $(RUN); \
	fi

test: $(INSTALLED)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/python -m pytest -q -n 2 --dist worksteal --durations=20

# the site, in site/; a warning is an error
docs: $(INSTALLED)
	$(MKDOCS) build --strict

# the site on http://127.0.0.1:8000, made anew when a page changes
docs-serve: $(INSTALLED)
	$(MKDOCS) serve --livereload

bench: $(INSTALLED)
	$(BIN)/python -m benchmarks.throughput --json results/throughput.json
	$(BIN)/python -m benchmarks.gymnasium --json results/gymnasium.json
	$(BIN)/python -m benchmarks.whole_run --json results/whole_run.json

# how far the robots agree: about an hour on two cores; it goes on where it was stopped
ladder: $(INSTALLED)
	$(BIN)/python -m benchmarks.ladder

convergence: $(INSTALLED)
	$(BIN)/python -m benchmarks.convergence

racing: $(INSTALLED)
	$(BIN)/python -m benchmarks.racing --threads 1 --json results/racing.json

overhead: $(INSTALLED)
	$(BIN)/python -m benchmarks.study --json results/study.json

recording: $(INSTALLED)
	$(BIN)/python -m benchmarks.recording --json results/recording.json

# the bridge against the emulated robot, two minutes in real time; wants an idle machine
bridge: $(INSTALLED)
	$(BIN)/python -m benchmarks.bridge --json results/bridge.json

# ten robots at once against ten emulated ones, a minute in real time; likewise
fleet: $(INSTALLED)
	$(BIN)/python -m benchmarks.fleet --json results/fleet.json

# PPO beside DE/best: 15 minutes; needs the extra ppo, which is not in dev
ppo: $(INSTALLED)
	$(PIP) '.[ppo]'
	$(BIN)/python -m benchmarks.ppo
	$(BIN)/python -m evolution.evaluate results/ppo/champion.json \
	  --json results/ppo/test.json
	$(BIN)/python -m benchmarks.ppo.figure

# champions in other worlds, kinematic and on wheels; fast ones are also driven slower.
# About 40 minutes on two cores. Then those in which the gains of the sensors are known to 10 %
gap: $(INSTALLED)
	$(BIN)/python -m evolution.gap \
	  $(foreach seed,1 2 3,$(PAPERS:%=results/paper/%/seed-$(seed))) \
	  results/transfer $(FOR_ROBOTS) --starts 10 --speeds 0.04 0.08 \
	  --kinds usual beyond corners --output results/gap
	$(BIN)/python -m evolution.gap $(FOR_ROBOTS) --starts 20 --speeds 0.08 \
	  --kinds calibrated-gains --output results/gap-calibrated

# what git keeps of the studies in runs/, and everything that is made of it
results: $(INSTALLED)
	$(BIN)/python -m evolution.reproduce.publish

# all pictures; the first needs EGL or OSMesa, the second a Vulkan driver
figures: $(INSTALLED) $(LESSON)
	$(BIN)/python -m evolution.replay $(CHAMPION) --starts test:0 \
	  --image docs/champion.png
	$(BIN)/python -m evolution.replay $(LESSON) --generations 0,10,50,last \
	  --starts test:3 --save runs/generations.rrd
	$(BIN)/python -m evolution.replay.viewer_picture runs/generations.rrd \
	  --output docs/replay.png
	$(BIN)/python -m evolution.report results/paper --output results/report-paper

# the run of docs/lesson.md
$(LESSON): | $(INSTALLED)
	$(BIN)/python -m evolution.run de-best --climb 1 --validation-starts 50 \
	  --test-starts 100 --output $(LESSON)

# the package with what evolution needs; then the tools of developers and the extras
$(PROGRAM): pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(PIP) .
	touch $(PROGRAM)

$(INSTALLED): $(PROGRAM)
	$(PIP) '.[dev]'
	touch $(INSTALLED)

clean:
	rm -rf .venv site .pytest_cache .ruff_cache .hypothesis
