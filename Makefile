# facetd.  make [VARIANT=release|debug|clang|asan|tsan|fuzz] [all|run|test|demo|check|...]; `make help` lists the targets.
VERSION := 0.1.0
VARIANT ?= release
B       := build/$(VARIANT)
MAKEFLAGS += -r
PKG_CONFIG ?= pkg-config
PORT    ?= 8080

ifeq ($(origin CC),default)
CC      := gcc
endif
CFLAGS  ?= -g
WARN    := -Wall -Wextra -Werror -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wvla -Wpointer-arith -Wwrite-strings
BASE    := -std=c11 -D_POSIX_C_SOURCE=200809L -fvisibility=hidden $(WARN)
# Sanitizers look at /proc, start threads, keep memory: code that cannot have them asks for this.
BASE    += -DSANITIZED=$(if $(filter asan tsan fuzz,$(VARIANT)),1,0)
VERSION_FLAG := -DFACET_VERSION='"$(VERSION)"'
release := -O2 -DNDEBUG
clang   := -O2 -DNDEBUG
debug   := -O0
asan    := -O1 -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
tsan    := -O1 -fsanitize=thread
fuzz    := -O1 -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all
RELEASE_CC := $(CC)
ifneq ($(filter clang fuzz,$(VARIANT)),)
CC      := clang
endif
VFLAGS  := $($(VARIANT))
$(if $(VFLAGS),,$(error unknown VARIANT '$(VARIANT)'))

# ---- kernels: one source, one object per (tier, io, isa) ------------------------
# A name missing here or in lib/dispatch.c is a link error.
KERNEL_FORMS := draft-float draft-double fast-float fast-double exact32-float exact32-double precise-double
ISAS  := base
ifneq ($(filter x86_64%,$(shell $(CC) -dumpmachine 2>/dev/null)),)
ISAS  += avx2 avx512
ISA_avx2   := -mavx2 -mfma
ISA_avx512 := -mavx512f -mavx512dq -mavx512vl -mavx512bw -mfma -mprefer-vector-width=512
endif
# No contraction (what is fused is written so), never -ffast-math (it breaks NaN handling and error-free sums).
KFLAGS         := -g1 -ffp-contract=off -fno-math-errno
KFLAGS_release := $(release) $(KFLAGS) -fno-trapping-math
KFLAGS_own     := $(if $(filter release clang,$(VARIANT)),$(VFLAGS) $(KFLAGS) -fno-trapping-math,$(VFLAGS) -O1 $(KFLAGS))
# Instrumented builds look for faults, not speed, and instrumented vectors take minutes to compile: asan
# has its own of two tiers, whose sources are those of all; a kernel shares nothing and gets no bytes of a
# client's, so tsan and fuzz have none.  The others are those of release.
ifneq ($(filter asan tsan fuzz,$(VARIANT)),)
ISAS   := $(filter-out avx2 avx512,$(ISAS))
endif
OWN_asan := fast-float fast-double precise-double
OWN      := $(if $(filter asan tsan fuzz,$(VARIANT)),$(OWN_$(VARIANT)),$(KERNEL_FORMS))
kernel_of = $(if $(filter $2,$(OWN)),$(B),build/release)/lib/kernel/$1-$2-$3.o
# Each source and the forms that it has; rough dielectrics take doubles alone.
FORMS_kernel     := $(KERNEL_FORMS)
FORMS_sampler    := $(KERNEL_FORMS)
FORMS_refraction := $(filter %-double,$(KERNEL_FORMS))
KERNELS  := $(foreach k,kernel sampler refraction,$(foreach f,$(FORMS_$k),$(foreach i,$(ISAS),$(call kernel_of,$k,$f,$i))))

# ---- layers: what each may include and link -------------------------------------
obj     = $(patsubst %.c,$(B)/%.o,$(wildcard $1/*.c))
LIB_O    := $(call obj,lib) $(KERNELS)
API_O    := $(call obj,api)
SERVER_O := $(call obj,server)
SUPPORT_O := $(call obj,tests/support)
# -iquote: a header of ours never stands in for a system's (api/limits.h for <limits.h>).
INC_lib    := -iquote lib -ffp-contract=off
INC_api    := -iquote lib -iquote api $(VERSION_FLAG) $(shell $(PKG_CONFIG) --cflags jansson OpenEXR libpng 2>/dev/null)
INC_server := -iquote api $(VERSION_FLAG) $(shell $(PKG_CONFIG) --cflags libmicrohttpd 2>/dev/null)
INC_tests  := -iquote tests/support $(INC_api) -ffp-contract=off
LDLIBS     := -lmicrohttpd -ljansson -lOpenEXRCore -lpng16 -ldeflate -lzstd -lpthread -lm
LDLIBS_test_router := -lz
# This test makes allocations fail, one after the other.
LDLIBS_test_memory := -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=aligned_alloc

# Tests of dirs in PER_ISA run once per instruction set, the others once; so do those of what tables are made and
# sampled by, which is scalar (that every set evaluates what is in them is accuracy/test_tables).
PER_ISA := tests/property tests/accuracy tests/extremes
SCALAR  := $(addprefix tests/property/test_,table_sample.c turned.c turned_sample.c)
TESTS_ISA  := $(patsubst tests/%.c,$(B)/tests/%,$(filter-out $(SCALAR),$(wildcard $(addsuffix /test_*.c,$(PER_ISA)))))
TESTS_ONCE := $(patsubst tests/%.c,$(B)/tests/%,$(wildcard tests/unit/test_*.c) $(SCALAR))
# tests/server: a test program that talks to the daemon, built once with the API and once with a
# stand-in (fake_api.c) whose requests take exactly as long as a test says.
TESTS_SERVER := $(patsubst tests/%.c,$(B)/tests/%,$(wildcard tests/server/test_*.c))
# Where threads are looked at, only programs that have some run; the cases go through that daemon too.
ifeq ($(VARIANT),tsan)
TESTS_ISA  :=
TESTS_ONCE := $(B)/tests/unit/test_share
endif
TESTS   := $(TESTS_ISA) $(TESTS_ONCE) $(TESTS_SERVER)

all: $(B)/facetd

# ---- the page: the files of page/, embedded by the assembler as they are and gzipped -------------
PAGE := $(sort $(wildcard page/*.html page/*.css page/*.js page/*.svg))
$(B)/page/files.c: page/embed.sh page $(PAGE)
	@mkdir -p $(@D)
	@page/embed.sh $(@D) $(PAGE) >$@.new && mv $@.new $@
$(B)/page/files.o: $(B)/page/files.c server/page.h Makefile
	$(CC) $(BASE) $(CFLAGS) $(VFLAGS) -iquote server $(INC_server) -c -o $@ $<
SERVER_O += $(B)/page/files.o

$(B)/facetd: $(SERVER_O) $(B)/libapi.a $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ $(LDLIBS)
$(B)/tests/server/facetd-fake: $(SERVER_O) $(B)/tests/server/fake_api.o
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lmicrohttpd -lpthread
$(TESTS_SERVER): $(B)/tests/server/daemon.o | $(B)/facetd $(B)/tests/server/facetd-fake
$(B)/libfacet.a: $(LIB_O)
$(B)/libapi.a: $(API_O)
$(B)/%.a:
	@rm -f $@
	ar rcs $@ $^

define kernel
$(call kernel_of,$1,$2-$3,$4): lib/kernel/$1.c Makefile
	@mkdir -p $$(@D)
	$(if $(filter $2-$3,$(OWN)),$$(CC),$$(RELEASE_CC)) $$(BASE) $$(CFLAGS) $(if $(filter $2-$3,$(OWN)),$$(KFLAGS_own),$$(KFLAGS_release)) $$(ISA_$4) -Ilib -DFACET_TIER=$2 -DFACET_TIER_$2=1 -DFACET_IO=$3 -DFACET_IO_$3=1 -DFACET_ISA=$4 -MMD -MP -c -o $$@ $$<
endef
$(foreach k,kernel sampler refraction,$(foreach f,$(FORMS_$k),$(foreach i,$(ISAS),$(eval $(call kernel,$k,$(firstword $(subst -, ,$f)),$(lastword $(subst -, ,$f)),$i)))))
$(B)/lib/dispatch.o: CPPFLAGS += '-DFACET_ISAS=$(foreach i,$(ISAS),ISA($i))'

$(B)/%.o: %.c Makefile
	@mkdir -p $(@D)
	$(CC) $(BASE) $(CFLAGS) $(VFLAGS) $(CPPFLAGS) $(INC_$(firstword $(subst /, ,$*))) -MMD -MP -c -o $@ $<
$(TESTS): %: %.o $(SUPPORT_O) $(B)/libapi.a $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ $(LDLIBS) $(LDLIBS_$(notdir $@))

# What measures the wire, and what feeds it nonsense: not tests by themselves.
WIRE := $(patsubst tests/%.c,$(B)/tests/%,$(wildcard tests/wire/bench_*.c))
$(WIRE): %: %.o $(B)/libapi.a $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ $(LDLIBS)
bench-wire: $(WIRE) ## nanoseconds per number and per direction of the wire, two threads against one
	@for b in $(WIRE); do $$b; done
check-numbers: $(B)/tests/unit/test_number ## the number codec on 10^8 random decimals and on every float (about 10 minutes)
	FACET_NUMBERS=1e8 $< && FACET_NUMBERS=all $< floats_round_trip

# Fuzz targets: VARIANT=fuzz links libFuzzer, every other variant the short form of make test.
FUZZ := $(patsubst tests/%.c,$(B)/tests/%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZ_MAIN := $(if $(filter fuzz,$(VARIANT)),-fsanitize=fuzzer,$(B)/tests/fuzz/short.o)
FUZZ_SECONDS ?= 60
FUZZ_MUTATIONS ?= 20000
$(FUZZ): %: %.o $(B)/libapi.a $(B)/libfacet.a $(filter %.o,$(FUZZ_MAIN))
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $*.o $(FUZZ_MAIN) $(B)/libapi.a $(B)/libfacet.a $(LDLIBS)
fuzz-short: $(FUZZ)
	@for f in $(FUZZ); do $$f tests/fuzz/corpus/$${f##*/fuzz_} $(FUZZ_MUTATIONS) || echo "FAIL $$f"; done
FUZZ_RUNS := number:100000000 request:10000000 multipart:10000000 map:1000000 bsdf:1000000 csv:1000000 merl:1000000 samples:1000000 utia:1000000
fuzz-all: $(FUZZ)
	@tests/fuzz/runs.sh $(SECONDS_EACH) $(FUZZ_RUNS)
fuzz: ## libFuzzer on the codec, the request path, forms and readers, FUZZ_SECONDS (60) each
	@$(MAKE) -s --no-print-directory VARIANT=fuzz SECONDS_EACH=$(FUZZ_SECONDS) fuzz-all
fuzz-runs: ## the same until the codec has had 1e8 inputs, requests and forms 1e7, each reader 1e6 (hours; goes on where it was stopped)
	@$(MAKE) -s --no-print-directory VARIANT=fuzz SECONDS_EACH=0 fuzz-all

# The readers of maps over seeds made of the damaged files of the shared data.
RUNS ?= 1000000
DATA := $(if $(FACET_DATA),$(FACET_DATA),../shared/data)
fuzz-map: ## libFuzzer on the readers of maps, RUNS (1000000) inputs
	@$(MAKE) -s --no-print-directory VARIANT=fuzz build/fuzz/tests/fuzz/fuzz_map
	@tests/fuzz/map.sh build/fuzz/tests/fuzz/fuzz_map $(RUNS) $(DATA)/exr $(DATA)/png

READER_FUZZERS := $(addprefix build/fuzz/tests/fuzz/fuzz_,bsdf csv merl samples utia)
fuzz-measurements: ## libFuzzer on every reader of measurements, RUNS inputs each
	@$(MAKE) -s --no-print-directory VARIANT=fuzz $(READER_FUZZERS)
	@tests/fuzz/measurements.sh build/fuzz $(RUNS)

# ---- the black-box client: shares no code with the product -------------------------
CLIENTS  := client abuse readme torture load latency wire
CLIENT_O := $(filter-out $(patsubst %,$(B)/tests/client/%.o,$(CLIENTS)),$(call obj,tests/client))
$(B)/tests/client/%.o: INC_tests :=
$(patsubst %,$(B)/tests/client/facet_%,$(CLIENTS)): $(B)/tests/client/facet_%: $(B)/tests/client/%.o $(CLIENT_O)
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lcurl -ljansson -lz -lpthread -lm
# Preloaded into a daemon: fails one call of it.
$(B)/tests/torture/libfault.so: tests/torture/fault.c tests/torture/fault.h
	@mkdir -p $(@D)
	gcc $(BASE) -g -O1 -fPIC -shared -fvisibility=default -o $@ $< -ldl
clients: $(B)/tests/torture/libfault.so $(patsubst %,$(B)/tests/client/facet_%,$(CLIENTS))


# ---- the committed table of fits ----------------------------------------------------------
$(B)/tests/fits/table: %: %.o $(B)/tests/fits/sources.o $(SUPPORT_O) $(B)/libapi.a $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ $(LDLIBS)
fit-table: $(B)/tests/fits/table ## fits all of shared data and rewrites tests/fits/TABLE.md (minutes)
	$< table | grep -v '^ok ' > $(B)/TABLE.md && mv $(B)/TABLE.md tests/fits/TABLE.md

# The quad-precision reference: always gcc (clang has no quadmath.h), never instrumented (it is slow enough).
REFERENCE_O := $(patsubst %.c,$(B)/%.o,$(wildcard tests/accuracy/reference*.c))
$(REFERENCE_O): $(B)/%.o: %.c Makefile
	@mkdir -p $(@D)
	gcc $(BASE) -g -O2 -Ilib -MMD -MP -c -o $@ $<
REFERENCED := $(TESTS_ISA) $(B)/tests/unit/test_reference $(B)/tests/unit/test_reference_samplers
$(REFERENCED): $(REFERENCE_O)
$(REFERENCED): LDLIBS += -lquadmath

# ---- the report on LEADR maps: tables and pictures in build/report ---------------------------
REPORT_LEADR := $(B)/tests/report/report_leadr
$(REPORT_LEADR): $(addprefix $(B)/tests/report/,report_leadr.o relief.o filtered.o) $(SUPPORT_O) $(B)/libapi.a $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ $(LDLIBS)
report-leadr: $(REPORT_LEADR) ## filtered slopes against brute force: tables and pictures in build/report (minutes)
	@mkdir -p build/report
	@FACET_REPORT=build/report $<
	@if command -v gnuplot >/dev/null; then (cd build/report && gnuplot ../../tests/report/leadr.gp); \
	else echo 'skip the curves: gnuplot is not installed'; fi

# ---- the bench of /v1/fit ---------------------------------------------------------------------
BENCH_FIT := $(B)/tests/bench/fit
$(BENCH_FIT): %: %.o $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lm
bench-fit: all $(BENCH_FIT) ## milliseconds of fits and extractions, of a MERL file through HTTP
	@tests/bench/fit.sh $(B)/facetd $(BENCH_FIT) build/bench-fit $(DATA)

# ---- the bench of /v1/leadr ------------------------------------------------------------------
MAKE_MAP := $(B)/tests/bench/make_map
$(MAKE_MAP): $(B)/tests/bench/make_map.o $(B)/tests/support/exr_file.o
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lm
bench-leadr: all $(MAKE_MAP) ## seconds and memory of map filtering through HTTP
	@tests/bench/leadr.sh $(B)/facetd $(MAKE_MAP)

# ---- checks -----------------------------------------------------------------------
# One variant: every test program, then the layers.  Prints a line "ok|FAIL|skip name" per test case.
# CHECK_ISAS=best: only the best instruction set this processor has.
CHECK_ISAS ?= $(ISAS)
check: $(TESTS) check-layers
	@tests/check.sh $(shell nproc 2>/dev/null || echo 2) '$(CHECK_ISAS)' $(TESTS_ONCE) $(TESTS_SERVER) -- $(TESTS_ISA)

# CONTRIBUTING's style, as far as a program can tell
check-format:
	@find lib api server tests page -name '*.[ch]' | xargs -n 30 clang-format-14 --dry-run -Werror && echo 'ok format'

# lib knows libc and libm; api knows no transport; kernels call nothing; each exports its own prefix only
check-layers: $(B)/libfacet.a $(B)/libapi.a
	@bad=0; \
	nm -u $(B)/libfacet.a | grep -E ' (json_|exr_|png_|MHD_|api_)' && { echo 'lib reaches up'; bad=1; }; \
	nm -u $(B)/libapi.a | grep -E ' MHD_' && { echo 'api knows the transport'; bad=1; }; \
	if [ $(VARIANT) = release ]; then nm -u $(KERNELS) | grep ' U ' && { echo 'a kernel calls out'; bad=1; }; fi; \
	nm -g --defined-only $(B)/libfacet.a | awk 'NF==3 && $$3 !~ /^(facet_|_)/ {print "lib exports", $$3; e=1} END {exit !e}' && bad=1; \
	nm -g --defined-only $(B)/libapi.a | awk 'NF==3 && $$3 !~ /^(api_|_)/ {print "api exports", $$3; e=1} END {exit !e}' && bad=1; \
	if grep -lE 'json_(object_get|array_get|number_value|real_value|integer_value|string_value|is_true)' api/*.c | grep -vE 'api/(field|json|query)' ; then echo 'JSON is taken apart outside the field tables'; bad=1; fi; \
	[ $$bad = 0 ] && echo "ok check-layers $(VARIANT)" || { echo "FAIL check-layers $(VARIANT)"; }

# The golden copy of GET /v1/openapi.json: a test compares, this rewrites.
openapi: $(B)/tests/unit/test_contract
	FACET_REWRITE=1 $< openapi_is_the_golden_copy

# ---- for people ---------------------------------------------------------------------
run: ## install what is missing, build, start on PORT (8080), print one answer; Ctrl-C ends it
	@$(MAKE) --no-print-directory deps WHEN=build
	@$(MAKE) -s --no-print-directory all
	@server/run.sh $(B)/facetd $(PORT)

test: ## install what is missing, build, run every test; ends with "N passed, N failed"
	@$(MAKE) --no-print-directory deps WHEN='build run test'
	@tests/extras.sh
	@tests/run.sh
EXAMPLES ?= 1300
schemathesis: all ## schemathesis against a daemon of its own, EXAMPLES (1300) for each of eight operations
	@tests/extras.sh; tests/extras.sh contract $(B)/facetd $(EXAMPLES)
extras: ## install below build/extras what tests use of npm and PyPI (make test does)
	@tests/extras.sh

torture: all clients ## fail every allocation and system call of every case's request, of start and end (3 minutes)
	$(B)/tests/client/facet_torture --daemon $(B)/facetd --fault $(B)/tests/torture/libfault.so --cases tests/client/cases --all yes --jobs 4

bench-http: all ## tiny answers against nginx at 16 to 512 connections, memory of 8000 idle connections, large evaluations
	@$(MAKE) --no-print-directory deps WHEN='bench-http test-extras'
	@$(MAKE) -s --no-print-directory clients
	@tests/bench_http.sh $(B)/facetd
	@$(B)/tests/client/facet_load --daemon $(B)/facetd --cases tests/client/cases --seconds 5 --connections 16,64,128,256,512 --idle 8000
	@$(B)/tests/client/facet_wire --daemon $(B)/facetd

bench-million: all clients ## large evaluations over HTTP: time a direction, two workers against one, memory, start of work
	@$(B)/tests/client/facet_wire --daemon $(B)/facetd

bench-latency: all clients ## how soon /healthz is answered while all workers are busy, and by the admin listener among 1000 tricklers
	$(B)/tests/client/facet_latency --daemon $(B)/facetd

SOAK_SECONDS ?= 1800
soak-http: all clients ## SOAK_SECONDS (1800) of mixed load, half of it wrong or given up: every answer right, memory steady
	$(B)/tests/client/facet_load --daemon $(B)/facetd --cases tests/client/cases --seconds $(SOAK_SECONDS)

test-extras: ## install what `make test` does without, and run the tests that skipped for want of it
	@$(MAKE) --no-print-directory deps WHEN='build run test test-extras'
	@tests/run.sh build extras

test-page: ## the page in a real browser against a live daemon: screenshots in build/page/
	@$(MAKE) --no-print-directory deps WHEN='build run test-page'
	@$(MAKE) -s --no-print-directory all
	@tests/extras.sh
	@tests/page.sh $(B)/facetd

demo: all ## send real data to every endpoint of a daemon of its own
	@tests/demo.sh $(B)/facetd

# A thousand million calls at the extremes, a million pairs through the public door.
SOAK := $(B)/tests/extremes/test_many $(B)/tests/accuracy/test_answers
# Of tables all that the short forms leave out.
SOAK_TABLES := $(addprefix $(B)/tests/,unit/test_slope_table unit/test_memory $(patsubst tests/%.c,%,$(SCALAR)))
soak: $(SOAK) $(SOAK_TABLES) $(B)/tests/property/test_energy ## the tests of extremes and of answered bounds, a hundred times as long, tables in full, and chi2
	@for t in $(SOAK_TABLES); do FACET_TEST_SCALE=3 $$t || exit 1; done
	@for t in $(SOAK); do for i in $(ISAS); do FACET_TEST_SCALE=100 FACET_ISA=$$i $$t || exit 1; done; done
	@FACET_TEST_SCALE=140 $(B)/tests/property/test_energy weights_never_exceed_fresnel # 1e7 configurations
	@$(MAKE) -s --no-print-directory chi2

# The test of samples against densities, on the whole grid.
CHI2 ?= 1e8
FROM ?= 0
chi2: $(B)/tests/property/test_sample_pdf ## chi squared of every sampler, model, shape, alpha and angle from point FROM (0) on, CHI2 (1e8; table no more than 1e7) samples each, on all processors (an hour and more on two)
	@FACET_CHI2=$(CHI2) FACET_CHI2_FROM=$(FROM) $< every_sampler_at_length

# The experiments of the papers, as tables and pictures.
REPORT := $(B)/tests/report/report
$(REPORT): $(addprefix $(B)/tests/,report/report.o report/kernels_report.o report/samplers.o support/rng.o) $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lquadmath -lm
report: ## furnaces, wasted samples, efficiency of the samplers: build/report/report.md, .csv, .png, .svg
	@$(MAKE) --no-print-directory deps WHEN='build report'
	@$(MAKE) -s --no-print-directory $(REPORT)
	@mkdir -p build/report && $(REPORT) build/report && tests/report/draw.sh build/report && echo "see build/report/report.md"

# Speed and error together: build/bench.json, build/bench/bench.md, build/bench/pareto.svg and .png.
BENCH := $(B)/tests/bench/bench
$(BENCH): $(addprefix $(B)/tests/,bench/bench.o bench/yardstick.o support/draw.o support/rng.o accuracy/reference.o) $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lquadmath -lm
# What the specialised loops gain over the general one: build/bench/specialised.json.
SPECIALISED := $(B)/tests/bench/specialised
$(SPECIALISED): $(addprefix $(B)/tests/,bench/specialised.o support/draw.o support/rng.o) $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lm
bench: ## speed and error of every quantity, tier and instruction set against the textbook: build/bench.json, build/bench/
	@$(MAKE) --no-print-directory deps WHEN='build report'
	@$(MAKE) -s --no-print-directory $(BENCH) $(SPECIALISED)
	@mkdir -p build/bench && $(BENCH) >build/bench.json && $(SPECIALISED) >build/bench/specialised.json
	@tests/bench/summary.py build/bench.json build/bench $(B)/lib/kernel >build/bench/bench.md && tests/bench/pareto.sh build/bench
	@cat build/bench/bench.md; echo; echo "see build/bench.json, build/bench/bench.md, build/bench/pareto.png"

BENCH_SAMPLERS := $(B)/tests/bench/samplers
$(BENCH_SAMPLERS): $(addprefix $(B)/tests/,bench/samplers.o report/samplers.o support/rng.o) $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lquadmath -lm
bench-samplers: $(BENCH_SAMPLERS) ## nanoseconds of a sample, each method against its own scalar double form: asked and measured
	@$<

BENCH_TABLES := $(B)/tests/bench/tables
$(BENCH_TABLES): $(addprefix $(B)/tests/,bench/tables.o support/draw.o support/rng.o) $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lm
bench-tables: $(BENCH_TABLES) ## nanoseconds and error of tabulated materials in every tier and instruction set
	@$<

BENCH_TRANSMISSION := $(B)/tests/bench/transmission
$(BENCH_TRANSMISSION): $(addprefix $(B)/tests/,bench/transmission.o support/textbook.o support/normals.o support/rng.o) $(B)/libfacet.a
	$(CC) $(VFLAGS) $(LDFLAGS) -o $@ $^ -lm
bench-transmission: $(BENCH_TRANSMISSION) ## nanoseconds a direction of rough glass in every tier, against its reflection and scalar formulas
	@$<

container: ## build the Dockerfile without a Docker engine, run the image and ask it
	@$(MAKE) --no-print-directory deps WHEN=container
	@tests/container.sh

PREFIX ?= /usr/local
install: all ## install facetd, its units and examples below $(DESTDIR)$(PREFIX)
	install -D -m 755 $(B)/facetd $(DESTDIR)$(PREFIX)/bin/facetd
	install -D -m 644 LICENSE $(DESTDIR)$(PREFIX)/share/doc/facetd/LICENSE
	install -D -m 644 README.md $(DESTDIR)$(PREFIX)/share/doc/facetd/README.md
	install -D -m 644 server/nginx.conf $(DESTDIR)$(PREFIX)/share/doc/facetd/nginx.conf
	install -d $(DESTDIR)$(PREFIX)/lib/systemd/system
	sed 's|/usr/local|$(PREFIX)|' server/facetd.service >$(DESTDIR)$(PREFIX)/lib/systemd/system/facetd.service
	install -m 644 server/facetd.socket $(DESTDIR)$(PREFIX)/lib/systemd/system/facetd.socket

help: ## this list
	@sed -n 's/^\([a-z][a-z-]*\):.*## /\1\t/p' $(firstword $(MAKEFILE_LIST)) | sort | expand -t 16
	@echo 'make NAME VARIANT=release|debug|clang|asan|tsan|fuzz builds in build/VARIANT'

# ---- packages.txt -------------------------------------------------------------------
# Without network and silent when nothing is missing; WHEN: which rows.
WHEN ?= build
WANTED  = $$(awk -F'[ |]+' -v when=' $(WHEN) ' '!/^\#/ && NF > 2 && index(when, " " $$2 " ") {print $$1}' packages.txt)
MISSING = $$(printf '%s\n' $(WANTED) | grep -vxF "$$(dpkg-query -W -f='$${Package} $${db:Status-Status}\n' $(WANTED) 2>/dev/null | sed -n 's/ installed$$//p')")

deps: ## install the Debian packages that are missing (WHEN="build test run container")
	@if ! command -v dpkg-query >/dev/null; then echo 'deps: this is not Debian; it needs the like of:' $(WANTED); exit 0; fi; \
	missing=$(MISSING); [ -n "$$missing" ] || exit 0; set -- $$missing; \
	echo "deps: installing $$*"; sudo=; \
	if [ "$$(id -u)" != 0 ]; then sudo=sudo; command -v sudo >/dev/null || \
	    { echo "deps: no root and no sudo; as root: apt-get install --no-install-recommends $$*" >&2; exit 1; }; fi; \
	$$sudo apt-get -qq update && $$sudo env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "$$@" || \
	    { echo "deps: apt-get failed; still needed: $$*" >&2; exit 1; }

# packages.txt tells the truth: nothing of it is missing, and what facetd links comes from its run rows.
deps-check: SHELL := /bin/bash
deps-check: $(B)/facetd
	@missing=$(MISSING); [ -z "$$missing" ] && echo "ok packages installed" || echo "FAIL packages missing:" $$missing
	@for lib in $$(objdump -p $< | awk '$$1 == "NEEDED" {print $$2}'); do \
	    owners=$$(dpkg-query -S "*/$$lib" 2>/dev/null | sed 's/:.*//' | sort -u | paste -sd'|'); \
	    grep -qE "^($$owners) *\| run " packages.txt || [[ "|$$owners|" == *"|libc6|"* ]] || { echo "FAIL packages: $$lib of $$owners is not a run row"; exit 1; }; \
	done; echo "ok packages run rows"

clean: ; rm -rf build
.PHONY: all bench bench-tables soak report openapi clients check check-layers check-format clean run test demo container install help deps deps-check schemathesis fuzz fuzz-short fuzz-all fuzz-runs extras bench-wire check-numbers fuzz-map report-leadr bench-leadr fuzz-measurements fit-table test-extras torture bench-http bench-latency soak-http bench-samplers bench-transmission chi2 test-page bench-million bench-fit
.SECONDARY:
-include $(shell find $(B) build/release/lib/kernel -name '*.d' 2>/dev/null)
