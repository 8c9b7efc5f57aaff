# make demo   a CAD part becomes an inspection scene, shown by both renderers; captures are diagnosed: out/demo/index.html
# make test   proves it; make test-slow proves what takes longer
# Each target installs what it needs: a virtual environment in .venv, and Debian packages where it may.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
PACKAGES := libegl1 libgl1 libgl1-mesa-dri libxrender1 libxi6 libxkbcommon0 libsm6 libxfixes3 libxxf86vm1
LIBRARIES := libEGL.so.1 libGL.so.1 libXrender.so.1 libXi.so.6 libxkbcommon.so.0 libSM.so.6 libXfixes.so.3 libXxf86vm.so.1

# programs start Python hundreds of times: what is compiled stays
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-slow lint format bench truth reference clean setup system screen

demo: setup
	$(BIN)/brightfield demo --out out/demo

test: setup screen
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder --durations=15

# diagnoses from end to end, series that are killed and go on, long statistics; some six minutes
test-slow: setup
	$(BIN)/python -m pytest -m slow -n 2 --dist loadfile --no-loadscope-reorder --durations=15

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: setup $(VENV)/.bench
	@for name in rasterizer cycles per_light exposure brdf_cost pixel_fit matrix_kernels; do echo "== $$name"; $(BIN)/python benchmarks/$$name.py || exit 1; done

# the figures of docs/truth.md; some ten minutes
truth: setup
	$(BIN)/python benchmarks/truth.py --out docs/truth.md

# docs/reflectance.md, the page of all reflectance models, with its pictures; some three minutes
reference: setup
	$(BIN)/python -m composer.gallery.reflectance --out docs

clean:
	rm -rf $(VENV) out build *.egg-info

setup: system $(VENV)/.installed

$(VENV)/.installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' \
	  || { echo "Brightfield needs Python 3.11 (bpy 5.0 has wheels for it alone); $(PYTHON) is another. Set PYTHON=/path/to/python3.11."; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) \
	  || { echo "Python's venv module is missing: install python3.11-venv."; exit 1; }
	$(BIN)/python -m pip install --disable-pip-version-check --progress-bar on -e '.[dev]'
	@touch $@

$(VENV)/.bench: $(VENV)/.installed
	$(BIN)/python -m pip install --disable-pip-version-check -e '.[dev,bench]'
	@touch $@

# a screen and a hand for the test that drives the window; it is skipped where they cannot be had
screen:
	@command -v Xvfb >/dev/null && command -v xdotool >/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    echo "Installing xvfb and xdotool"; \
	    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq xvfb xdotool >/dev/null; } || true; \
	  else \
	    echo "Without xvfb and xdotool the window's test is skipped: sudo apt-get install xvfb xdotool"; \
	  fi; }

# the shared libraries that OpenGL through EGL and bpy load
system:
	@missing=""; for library in $(LIBRARIES); do \
	  $(PYTHON) -c "import ctypes; ctypes.CDLL('$$library')" 2>/dev/null || missing="$$missing $$library"; done; \
	if [ -n "$$missing" ]; then \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    echo "Installing the system libraries$$missing"; \
	    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $(PACKAGES) >/dev/null; \
	  else \
	    echo "Missing system libraries:$$missing"; \
	    echo "Install them with: sudo apt-get install $(PACKAGES)"; exit 1; \
	  fi; \
	fi
