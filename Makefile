# Everything a newcomer needs: `make demo` and `make test`. Each sets up what it uses.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
UV     := uv==0.13.9
OUT    ?= out

# Every command is a process of its own: without the bytecode of what it imports each one takes two
# seconds longer to start.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo view test test-slow test-robots lint bench compare pictures readme docs reference wheel-test \
  install clean
.DEFAULT_GOAL := demo

demo: $(VENV)/installed-run          ## run the paper's studies and write out/report.html
	$(BIN)/asperity demo --out $(OUT) --overwrite

view: $(VENV)/installed-view         ## a page in the browser on a running scene: make view SCENE=hammer-blocks
	$(BIN)/asperity view $(SCENE)

test: $(VENV)/installed-dev          ## the tests (two processes and one of low priority, one shared compile cache)
	@sh .ci/browser.sh
	$(BIN)/python -m pytest -n 3 -m "not slow"

test-slow: $(VENV)/installed-dev
	$(BIN)/python -m pytest -m slow

# Robotics packages run on MuJoCo 3.3 to 3.5, and need an environment of their own.
ROBOTS := .venv-robots
CLIENTS := robosuite==1.5.1 metaworld==3.0.0 gymnasium-robotics==1.4.2 'dm_control<1.0.50' packaging mujoco==3.5.0 'numpy>=2'
test-robots: $(ROBOTS)/installed     ## textures in MuJoCo 3.5, and in robosuite, metaworld, gymnasium-robotics, dm_control
	$(ROBOTS)/bin/python -m pytest -p no:xdist -q tests/mujoco

lint: $(VENV)/installed-dev          ## style, types, the order of imports, the rules of CONTRIBUTING.md
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python tools/check_source.py

# The servo for ten minutes of each scene; SERVO_SECONDS=3600 is an hour.
SERVO_SECONDS ?= 600
bench: $(VENV)/installed-compare     ## speed, as ratios in one run; with the peers that it is compared to
	@mkdir -p $(OUT); missed=; \
	$(BIN)/python benchmarks/bench_meshes.py --figure $(OUT)/growth.svg || missed="$$missed meshes"; \
	for name in studies contact mujoco devices energy hand_study sweep page read; do \
	  $(BIN)/python benchmarks/bench_$$name.py || missed="$$missed $$name"; \
	done; $(BIN)/python benchmarks/bench_servo.py --seconds $(SERVO_SECONDS) --empty 0.2 --kills 100 \
	  || missed="$$missed servo"; test -z "$$missed" || { echo "missed a bar, or failed:$$missed"; exit 1; }

compare: $(VENV)/installed-compare   ## methods side by side, into the documentation: docs/comparison.md
	$(BIN)/asperity compare probe-plate --seconds 0.5 --docs docs --out $(OUT)/compare --overwrite

pictures: $(VENV)/installed-dev      ## the README's animation, and the page with each scene
	$(BIN)/python docs/images/demo.py
	$(BIN)/python docs/images/scenes.py
	@sh .ci/browser.sh
	$(BIN)/python docs/images/page.py
	for scene in probe-plate-dots hammer-blocks file-cad; do $(BIN)/asperity view $$scene --no-open \
	  --port 0 --screenshot src/asperity/viewer/pictures/$$scene.jpg || exit 1; done

reference: $(VENV)/installed-run     ## the command reference, docs/cli.md, from the parser
	$(BIN)/python tools/cli_reference.py

readme: $(VENV)/installed-dev        ## the shell commands of README.md, in order, in a fresh folder
	$(BIN)/python -m pytest -m slow tests/test_documents.py

docs: $(VENV)/installed-docs         ## the site, in docs/_build/html
	$(BIN)/python -m sphinx -W --keep-going -b html docs docs/_build/html

wheel-test: $(VENV)/installed-dev    ## build a wheel, install it in a bare environment, run the demo
	sh .ci/wheel_test.sh $(BIN)/python

$(ROBOTS)/installed: pyproject.toml Makefile
	$(PYTHON) -m venv $(ROBOTS)
	$(ROBOTS)/bin/python -m pip install -q --disable-pip-version-check '$(UV)'
	$(ROBOTS)/bin/uv pip install -q --python $(ROBOTS)/bin/python -e '.[test]' $(CLIENTS)
	@touch $@

install: $(VENV)/installed-run
clean:
	rm -rf $(VENV) $(ROBOTS) $(OUT) docs/_build build dist .pytest_cache .ruff_cache .mypy_cache

# Installation. uv does it in seconds; where uv cannot run, pip does the same more slowly.
define INSTALL
	@echo "asperity: installing into $(VENV) ..."
	@start=$$(date +%s); \
	  { $(BIN)/python -m pip install -q --disable-pip-version-check '$(UV)' \
	    && $(BIN)/uv pip install -q --python $(BIN)/python -c constraints.txt -e '.$(1)'; } \
	  || $(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.$(1)'; \
	  status=$$?; [ $$status = 0 ] || exit $$status; \
	  echo "asperity: download and installation took $$(( $$(date +%s) - start )) s"
	@touch $@
endef

# In a variable, since a comma written in a call would end its argument.
PEERS := [compare,haply,sweep,view]

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
$(VENV)/installed-run: pyproject.toml constraints.txt | $(BIN)/python
	$(call INSTALL,)
$(VENV)/installed-compare: pyproject.toml constraints.txt | $(BIN)/python
	$(call INSTALL,$(PEERS))
$(VENV)/installed-view: pyproject.toml constraints.txt | $(BIN)/python
	$(call INSTALL,[view])
$(VENV)/installed-dev: pyproject.toml constraints.txt | $(BIN)/python
	$(call INSTALL,[dev])
$(VENV)/installed-docs: pyproject.toml constraints.txt | $(BIN)/python
	$(call INSTALL,[docs])
