#include "body_strobe.h"

#include <math.h>

#include "body.h"

/* Is the clock described, and does the forcing have a phase? */
static bool counts(const vi_body *c)
{
    return c->strobe.described && c->model.clock.angular_frequency > 0.0;
}

static bool is_strobe(vi_instant now)
{
    return now.rest == 0.0 && now.rest_low == 0.0;
}

static vi_instant next_after(vi_instant now)
{
    return (vi_instant){now.periods + 1, 0.0, 0.0};
}

void vi_strobe_start(vi_body *c)
{
    const vi_instant now = c->state.now;
    c->strobe.ticks = 0;
    c->strobe.passed = is_strobe(now) ? now.periods - 1 : now.periods;
    c->strobe.displacement = c->displacement;
    c->strobe.velocity = c->velocity;
}

bool vi_strobe_is_due(const vi_body *c)
{
    return counts(c) && c->state.now.periods > c->strobe.passed;
}

bool vi_strobe_ends_step(const vi_body *c, const vi_step_request *request, vi_instant *target)
{
    const vi_instant next = next_after(c->state.now);
    if (!counts(c) || !request->stop_at_contacts || !request->early_return || !vi_clock_is_before(next, *target)) {
        return false;
    }
    *target = next;
    return true;
}

void vi_strobe_pass(vi_body *c, const vi_step_request *request)
{
    const bool stops = request->stop_at_contacts && is_strobe(c->state.now);
    const int64_t passed = stops ? c->state.now.periods - 1 : c->state.now.periods;
    c->strobe.passed = passed > c->strobe.passed ? passed : c->strobe.passed;
}

double vi_strobe_tick(vi_body *c)
{
    const vi_instant strobe = {c->strobe.passed + 1, 0.0, 0.0};
    c->strobe.ticks = vi_strobe_is_due(c);
    if (!c->strobe.ticks) {
        return 0.0;
    }
    c->strobe.passed = c->state.now.periods;
    c->strobe.displacement = c->displacement;
    c->strobe.velocity = c->velocity;
    return vi_clock_elapsed(&c->model.clock, strobe, c->state.now);
}

double vi_strobe_next(vi_body *c)
{
    c->strobe.ticks = 0;
    return counts(c) ? vi_clock_time(&c->model.clock, next_after(c->state.now)) : HUGE_VAL;
}
