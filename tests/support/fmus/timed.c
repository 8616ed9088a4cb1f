/* Clocks of all kinds whose interval is not fixed, in one model that knows its ticks before the importer does.
 *
 * `beat` is tunable: its interval is `period`. `stride` is changing: interval (1 + strides) / 8. `fuse` is a countdown
 * that every third beat lights, with the interval `delay`. `out` ticks at every second beat and at each fuse. `hit` is
 * triggered by others; at a hit `last` becomes u. An interval that is not asked for, a tick that is missed and one at a
 * wrong time are errors. sum' = beats + strides + fuses + hits, so the sum reveals the times of the ticks. */
#include <math.h>

#include "fmi3Functions.h"
#include "model.h"

enum { U = 1, BEATS, STRIDES, FUSES, HITS, SUM, PERIOD, SHIFT, DELAY, LAST, GATED };
/* s: the next ticks, infinite where unknown; the period that the importer knows. Sets of clocks: those that tick now,
 * and those with an interval that the importer has to ask for. */
enum { NEXT_BEAT = 12, NEXT_STRIDE, NEXT_FUSE, KNOWN_PERIOD, ACTIVE, LIT, UNASKED };
enum { BEAT = 40, STRIDE, FUSE, OUT, HIT };
static const double ROOM = 1e-9;

const bool model_has_state = true;
const bool model_has_event_mode = true;

static unsigned bit(unsigned clock)
{
    return 1U << (clock - BEAT);
}

/* Put a clock into a set of clocks, or out of it. */
static void change(model *m, int set, unsigned clock, bool inside)
{
    const unsigned others = (unsigned)m->value[set] & ~bit(clock);
    m->value[set] = (double)(inside ? others | bit(clock) : others);
}

static bool is_in(const model *m, int set, unsigned clock)
{
    return ((unsigned)m->value[set] & bit(clock)) != 0U;
}

static bool is_active(const model *m, unsigned clock)
{
    return is_in(m, ACTIVE, clock);
}

static bool is_out(const model *m)
{
    return (is_active(m, BEAT) && fmod(m->value[BEATS], 2.0) > 0.0) || is_active(m, FUSE);
}

static void close_all(model *m)
{
    m->value[ACTIVE] = 0.0;
    m->closed = 1U << U | 1U << GATED;
}

void model_start(model *m)
{
    *m = (model){.value = {[PERIOD] = 0.25, [DELAY] = 0.0625}};
    m->value[NEXT_BEAT] = m->value[NEXT_STRIDE] = m->value[NEXT_FUSE] = INFINITY;
}

bool model_begin(model *m, void *instance)
{
    (void)instance;
    close_all(m);
    return isfinite(m->value[NEXT_BEAT]) && isfinite(m->value[NEXT_STRIDE]);
}

void model_calculate(model *m)
{
    m->value[GATED] = 100.0 * m->value[BEATS] + m->value[FUSES];
}

step_answer model_step(model *m, double size, void *instance)
{
    const double first = fmin(m->value[NEXT_BEAT], fmin(m->value[NEXT_STRIDE], m->value[NEXT_FUSE]));
    const bool is_late = first < m->time + size - ROOM;
    if (is_late || m->value[ACTIVE] != 0.0 || m->value[UNASKED] != 0.0) {
        say(instance, is_late ? "a tick was missed" : "an interval was not asked for", (int)m->value[UNASKED], first);
        return STEP_FAILS;
    }
    m->value[SUM] += size * (m->value[BEATS] + m->value[STRIDES] + m->value[FUSES] + m->value[HITS]);
    return STEP_DONE;
}

bool model_update(model *m)
{
    if (is_active(m, BEAT)) {
        m->value[BEATS] += 1.0;
        m->value[NEXT_BEAT] += m->value[KNOWN_PERIOD];
    }
    if (is_active(m, STRIDE)) {
        m->value[STRIDES] += 1.0;
        change(m, UNASKED, STRIDE, true);
    }
    if (is_active(m, FUSE)) {
        m->value[FUSES] += 1.0;
        m->value[LIT] = 0.0;
        m->value[NEXT_FUSE] = INFINITY;
    } else if (is_active(m, BEAT) && m->value[LIT] == 0.0 && fmod(m->value[BEATS], 3.0) == 0.0) {
        m->value[LIT] = 1.0;
        change(m, UNASKED, FUSE, true);
    }
    if (is_active(m, HIT)) {
        m->value[HITS] += 1.0;
        m->value[LAST] = m->value[U];
    }
    close_all(m);
    return false;
}

step_answer model_at(model *m, occasion where, void *instance)
{
    (void)m, (void)where, (void)instance;
    return STEP_DONE;
}

/* ---- functions of FMI 3.0 for clocks; an instance begins with its model ---- */

static bool is_due(const model *m, unsigned clock)
{
    static const int NEXT[] = {NEXT_BEAT, NEXT_STRIDE, NEXT_FUSE};
    return clock == HIT || (clock <= FUSE && fabs(m->value[NEXT[clock - BEAT]] - m->time) <= ROOM);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                        const fmi3Clock values[])
{
    model *m = instance;
    for (size_t k = 0; k < count; k++) {
        const unsigned clock = references[k];
        if (clock < BEAT || clock > HIT || !values[k] || is_active(m, clock) || !is_due(m, clock)) {
            say(instance, "a tick at a wrong time", (int)clock, m->time);
            return fmi3Error;
        }
        change(m, ACTIVE, clock, true);
        m->closed &= clock == HIT ? ~(1U << U) : ~0U;
        m->closed &= is_out(m) ? ~(1U << GATED) : ~0U;
    }
    return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Clock values[])
{
    if (count != 1 || references[0] != OUT) {
        return fmi3Error;
    }
    values[0] = is_out(instance);
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    model *m = instance;
    if (count != 1 || references[0] < BEAT || references[0] > FUSE) {
        return fmi3Error;
    }
    const bool is_new = is_in(m, UNASKED, references[0]);
    change(m, UNASKED, references[0], false);
    const bool is_first = !isfinite(m->value[NEXT_STRIDE]) || !isfinite(m->value[NEXT_BEAT]);
    switch (references[0]) {
    case BEAT:
        intervals[0] = m->value[PERIOD];
        qualifiers[0] = m->value[PERIOD] != m->value[KNOWN_PERIOD] ? fmi3IntervalChanged : fmi3IntervalUnchanged;
        if (m->value[PERIOD] != m->value[KNOWN_PERIOD]) {
            m->value[NEXT_BEAT] = m->time + (isfinite(m->value[NEXT_BEAT]) ? m->value[PERIOD] : m->value[SHIFT]);
        }
        m->value[KNOWN_PERIOD] = m->value[PERIOD];
        return fmi3OK;
    case STRIDE:
        intervals[0] = (1.0 + m->value[STRIDES]) / 8.0;
        qualifiers[0] = is_first || is_new ? fmi3IntervalChanged : fmi3IntervalUnchanged;
        m->value[NEXT_STRIDE] = is_first || is_new ? m->time + intervals[0] : m->value[NEXT_STRIDE];
        return fmi3OK;
    default:
        intervals[0] = m->value[DELAY];
        qualifiers[0] = m->value[LIT] == 0.0 ? fmi3IntervalNotYetKnown
                        : is_new             ? fmi3IntervalChanged
                                             : fmi3IntervalUnchanged;
        m->value[NEXT_FUSE] = is_new ? m->time + m->value[DELAY] : m->value[NEXT_FUSE];
        return fmi3OK;
    }
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                               fmi3Float64 shifts[])
{
    if (count != 1 || references[0] != BEAT) {
        return fmi3Error; /* aperiodic clocks have none */
    }
    shifts[0] = ((model *)instance)->value[SHIFT];
    return fmi3OK;
}
