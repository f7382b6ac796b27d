# make fly    fly a mission in the simulated lab; the first call also installs what it needs
# make test   everything that must hold: style, types, tests
# make results   fly and measure all of docs/results.md in five hours; it goes on where it stopped
#
# Choose with variables: make fly SCENE=test-a SEED=7, make PYTHON=/path/to/python3 test

VENV ?= .venv
TREE ?= trees/survey_and_land.xml
SCENE ?= train-a
SEED ?= 0
OUT ?= out
# The survey of a first flight ends when 30 s covered less than 1 % of new ground.
ifeq ($(TREE),trees/survey_and_land.xml)
FLY_ARGS ?= --set ExploreFor.min_gain=0.01
endif
PYTEST_ARGS ?= -n auto --maxprocesses 8

export PYTHON
BIN := $(VENV)/bin
NEEDS := pyproject.toml constraints.txt tools/install.sh

.PHONY: fly test results lint format clean distclean

fly: $(VENV)/.for-flying
	@mkdir -p $(OUT)
	@failed=0; \
	$(BIN)/uav-bt fly $(TREE) --scene $(SCENE) --seed $(SEED) $(FLY_ARGS) \
		--report $(OUT)/report.json --video $(OUT)/mission.mp4 || failed=$$?; \
	[ ! -f $(OUT)/mission.mp4 ] || echo "Open $(OUT)/mission.mp4 to see the flight."; \
	exit $$failed

# The tests come last, and come also when the style is wrong, so that one run tells everything. A shell
# that has sourced ROS has packages for another Python on PYTHONPATH, and pytest loads their plug-ins.
test: $(VENV)/.for-developing
	@failed=0; \
	$(MAKE) --no-print-directory lint || failed=1; \
	env -u PYTHONPATH $(BIN)/python -m pytest $(PYTEST_ARGS) || failed=1; \
	exit $$failed

results: $(VENV)/.for-developing
	@$(BIN)/python -m benchmarks.results $(RESULTS_ARGS)

lint: $(VENV)/.for-developing
	@failed=0; \
	$(BIN)/ruff check --quiet --output-format concise . || failed=1; \
	$(BIN)/ruff format --check --quiet --output-format concise . || failed=1; \
	$(BIN)/mypy --no-error-summary || failed=1; \
	exit $$failed

format: $(VENV)/.for-developing
	@$(BIN)/ruff check --quiet --fix .
	@$(BIN)/ruff format --quiet .

$(VENV)/.for-flying: $(NEEDS)
	@sh tools/install.sh $(VENV)
	@touch $@

$(VENV)/.for-developing: $(NEEDS)
	@sh tools/install.sh $(VENV) dev
	@touch $@ $(VENV)/.for-flying

clean:
	rm -rf $(OUT) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .benchmarks .hypothesis
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
