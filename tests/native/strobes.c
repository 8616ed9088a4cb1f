/* The clock of the strobes under random steps, tuned frequencies and importers. It ticks once at each strobe at which the
 * importer stops, at its very instant, and never elsewhere. */
#include "../../fmus/native/bodies/body_strobe.c"

#include <string.h>

#include "check.h"

static vi_body body;

/* A body at this time with a clock of random frequency and phase. */
static void start(uint64_t *seed, double time)
{
    memset(&body, 0, sizeof body);
    body.strobe.described = 1;
    CHECK(vi_clock_start(&body.model.clock, uniform(seed, 0.1, 50.0), uniform(seed, -9.0, 9.0), 1.0), "%s", "clock");
    CHECK(vi_clock_instant(&body.model.clock, time, 0.0, &body.state.now), "%s", "time");
    vi_strobe_start(&body);
}

static bool is_at_strobe(void)
{
    return body.state.now.rest == 0.0 && body.state.now.rest_low == 0.0;
}

/* Step on like the importer of this request; true where the step ended early at a strobe. */
static bool step(uint64_t *seed, const vi_step_request *request)
{
    const double period = body.model.clock.period;
    vi_instant target = vi_clock_after(&body.model.clock, body.state.now, uniform(seed, 0.0, 3.0) * period);
    if (choice(seed, 5) == 0) {
        target = next_after(body.state.now);
    }
    const bool early = vi_strobe_ends_step(&body, request, &target);
    CHECK(!vi_clock_is_before(target, body.state.now), "%s", "steps go on");
    body.state.now = target;
    vi_strobe_pass(&body, request);
    return early;
}

static void tune(uint64_t *seed)
{
    vi_clock_retune(&body.model.clock, uniform(seed, 0.1, 50.0), &body.state.now, NULL, 0);
}

static void each_strobe_ticks_once(uint64_t *seed)
{
    const vi_step_request request = {0.0, 1.0, true, true};
    start(seed, choice(seed, 2) == 0 ? 0.0 : uniform(seed, -100.0, 1e5));
    const int64_t first = body.state.now.periods + (is_at_strobe() ? 0 : 1);
    int64_t ticks = 0;
    for (int n = 0; n < 300; ++n) {
        CHECK(vi_strobe_is_due(&body) == (is_at_strobe() && body.strobe.passed < body.state.now.periods), "%d", n);
        if (vi_strobe_is_due(&body)) {
            CHECK(body.state.now.periods == first + ticks, "tick %lld", (long long)ticks);
            CHECK(vi_strobe_tick(&body) == 0.0, "%s", "late");
            CHECK(body.strobe.ticks == 1 && !vi_strobe_is_due(&body), "%s", "twice");
            ticks += 1;
            const double next = vi_clock_time(&body.model.clock, next_after(body.state.now));
            CHECK(vi_strobe_next(&body) == next && body.strobe.ticks == 0, "%.17g", next);
        }
        if (choice(seed, 4) == 0) {
            tune(seed);
        }
        CHECK(!step(seed, &request) || vi_strobe_is_due(&body), "%s", "an early end is a strobe");
    }
    CHECK(ticks > 100, "%lld", (long long)ticks);
}

/* Strobes at which the importer cannot stop are passed; one that it leaves alone does not tick later. */
static void other_importers_see_no_late_tick(uint64_t *seed)
{
    start(seed, uniform(seed, 0.0, 10.0));
    for (int n = 0; n < 300; ++n) {
        const vi_step_request request = {0.0, 1.0, choice(seed, 2) == 0, choice(seed, 2) == 0};
        const bool early = step(seed, &request);
        CHECK(!early || (request.stop_at_contacts && request.early_return), "%s", "an end that is not allowed");
        CHECK(!vi_strobe_is_due(&body) || (is_at_strobe() && request.stop_at_contacts), "%s", "late");
        if (vi_strobe_is_due(&body) && choice(seed, 2) == 0) {
            CHECK(vi_strobe_tick(&body) == 0.0, "%s", "late");
        }
    }
}

/* In model exchange the importer sets the time, and may miss the strobe: then the clock ticks late, and tells by how much. */
static void a_missed_strobe_ticks_late(uint64_t *seed)
{
    start(seed, uniform(seed, 0.0, 10.0));
    const double late = uniform(seed, 0.1, 0.9) * body.model.clock.period;
    body.state.now = vi_clock_after(&body.model.clock, next_after(body.state.now), late);
    CHECK(vi_strobe_is_due(&body), "%s", "due");
    const double told = vi_strobe_tick(&body);
    CHECK(fabs(told - late) <= 1e-12 * body.model.clock.period, "%.17g, expected %.17g", told, late);
    CHECK(!vi_strobe_is_due(&body), "%s", "once");
}

static void without_a_phase_or_a_clock_nothing_ticks(uint64_t *seed)
{
    const vi_step_request request = {0.0, 1.0, true, true};
    for (int described = 0; described < 2; ++described) {
        start(seed, 0.0);
        body.strobe.described = described;
        if (described) {
            CHECK(vi_clock_start(&body.model.clock, 0.0, 0.0, 1.0), "%s", "clock");
        }
        for (int n = 0; n < 100; ++n) {
            CHECK(!step(seed, &request) && !vi_strobe_is_due(&body), "%d", n);
            CHECK(isinf(vi_strobe_next(&body)), "%d", n);
        }
    }
}

int main(void)
{
    uint64_t seed = 42;
    for (int n = 0; n < 300; ++n) {
        each_strobe_ticks_once(&seed);
        other_importers_see_no_late_tick(&seed);
        a_missed_strobe_ticks_late(&seed);
    }
    without_a_phase_or_a_clock_nothing_ticks(&seed);
    return 0;
}
