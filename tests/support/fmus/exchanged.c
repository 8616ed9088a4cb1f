#include "exchanged.h"

#include <math.h>
#include <string.h>

enum { TIME = 0 };
static const double GRAVITY = 9.81, RESTITUTION = 0.8, MILLION = 1e6, ROOM = 1e-9, MOST_FORCE = 1e3;

void exchanged_start(exchanged *m)
{
    memset(m, 0, sizeof *m);
    m->real[X] = m->scale = 1.0;
    m->real[AT] = 0.25;
    m->next = m->fuse = INFINITY;
}

static int kind_of(const exchanged *m)
{
    return (int)m->real[KIND];
}

bool exchanged_takes(const exchanged *m, mode wanted)
{
    return m->mode == wanted;
}

/* Is the present point further than `at` from the last completed step? */
static bool is_far(const exchanged *m)
{
    return m->real[TIME] > m->completed + m->real[AT];
}

answer exchanged_states(exchanged *m, const double states[2])
{
    if (kind_of(m) == SHORT_STATES && is_far(m)) {
        return ANSWER_DISCARD;
    }
    m->real[X] = states[0];
    m->real[V] = states[1];
    return ANSWER_OK;
}

/* The lift of the cam over its angle: a hollow and a bump beside the angle `at`. */
static double cam_lift(const exchanged *m)
{
    const double off = m->real[X] - m->real[AT];
    return 2.0 * off / (1.0 + off * off);
}

static double cam_slope(const exchanged *m)
{
    const double off = m->real[X] - m->real[AT], width = 1.0 + off * off;
    return 2.0 * (1.0 - off * off) / (width * width);
}

answer exchanged_rates(exchanged *m, double rates[2])
{
    const bool is_late = m->real[TIME] >= m->real[AT];
    rates[0] = m->real[V];
    rates[1] = -m->real[X] + m->real[U] + m->d;
    switch (kind_of(m)) {
    case BALL: rates[1] = -GRAVITY; return ANSWER_OK;
    case STAIRS: rates[1] = 0.0; return ANSWER_OK;
    case CLOCKED: rates[1] = 0.0; return m->is_lit || m->real[TIME] > m->fuse + ROOM ? ANSWER_ERROR : ANSWER_OK;
    case LAST_FALL:
    case FALLING: rates[1] = m->real[U] / m->real[AT] - GRAVITY; return ANSWER_OK;
    case PENDULUM: rates[1] = m->real[U] * cos(m->real[X]) - GRAVITY * sin(m->real[X]); return ANSWER_OK;
    case CAM: rates[1] = m->real[U] * cam_slope(m); return ANSWER_OK;
    case WEAK: rates[1] = fmax(-MOST_FORCE, fmin(MOST_FORCE, m->real[U])) - m->real[X]; return ANSWER_OK;
    case SHORT_RATES: return is_far(m) ? ANSWER_DISCARD : ANSWER_OK;
    case NAN_RATES: rates[1] = is_far(m) ? (double)NAN : rates[1]; return ANSWER_OK;
    case RATES_FAIL: return is_late ? ANSWER_ERROR : ANSWER_OK;
    case RATES_FATAL: return is_late ? ANSWER_FATAL : ANSWER_OK;
    case RATES_END: rates[1] = is_late ? (double)NAN : rates[1]; return ANSWER_OK;
    default: return ANSWER_OK;
    }
}

answer exchanged_indicators(exchanged *m, double *indicator)
{
    if (kind_of(m) == SHORT_INDICATORS && is_far(m)) {
        return ANSWER_DISCARD;
    }
    *indicator = kind_of(m) == BALL ? m->real[X] : 1.0 - m->real[U] / 10.0; /* u above 10 is an event */
    return ANSWER_OK;
}

void exchanged_completed(exchanged *m, bool *event, bool *ends)
{
    m->real[STEPS] += 1.0;
    m->completed = m->real[TIME];
    *event = kind_of(m) == STEPPED && !m->has_stopped && m->real[X] > m->real[AT];
    *ends = kind_of(m) == ENDS_AT_STEP && m->real[TIME] > m->real[AT];
}

static void bounce(exchanged *m, decisions *made)
{
    if (m->real[X] <= 0.0 && m->real[V] < 0.0) {
        m->real[X] = 0.0;
        m->real[V] *= -RESTITUTION;
        m->real[COUNT] += 1.0;
        made->values = true;
    }
}

/* The time event of a kind, where it is due. */
static void tick(exchanged *m, decisions *made)
{
    m->next = INFINITY;
    m->real[COUNT] += 1.0;
    switch (kind_of(m)) {
    case STAIRS:
        m->next = (m->real[COUNT] + 1.0) * m->real[AT];
        m->real[V] = m->real[COUNT];
        made->values = true;
        break;
    case ENDS_AT_EVENT: made->ends = true; break;
    case RESCALED:
        m->scale = MILLION;
        m->real[X] *= MILLION;
        m->real[V] *= MILLION;
        made->values = made->nominals = true;
        break;
    case STUCK: m->next = m->real[TIME]; break;
    default: break;
    }
}

bool exchanged_tick(exchanged *m, unsigned clock)
{
    const bool is_due = clock == TICK || (clock == FUSE && fabs(m->fuse - m->real[TIME]) <= ROOM);
    m->clock = clock;
    return is_due && m->mode == EVENT_MODE;
}

static void end_tick(exchanged *m, decisions *made)
{
    m->real[COUNT] += m->clock == TICK;
    m->real[V] = m->clock == TICK ? m->real[V] + 1.0 : 0.0;
    m->is_lit = m->is_lit || (m->clock == TICK && m->real[COUNT] == 3.0);
    m->fuse = m->clock == FUSE ? (double)INFINITY : m->fuse;
    m->clock = 0;
    made->values = true;
}

answer exchanged_update(exchanged *m, decisions *made)
{
    const int kind = kind_of(m);
    memset(made, 0, sizeof *made);
    if (m->settled && kind == BALL) {
        bounce(m, made);
    } else if (m->settled && kind == STEPPED && m->real[X] > m->real[AT] && !m->has_stopped) {
        m->has_stopped = made->values = true;
        m->real[V] = 0.0;
        m->real[COUNT] += 1.0;
    } else if (m->settled && kind == SPRING && m->real[U] > 10.0) {
        m->real[COUNT] += 1.0;
    }
    made->ends = m->settled && kind == LAST_FALL && m->real[V] > 0.0;
    const bool ticks = kind == STAIRS || kind == ENDS_AT_EVENT || kind == RESCALED || kind == ENDLESS || kind == STUCK;
    if (ticks && !m->settled) {
        m->next = m->real[AT];
    } else if (ticks && m->real[TIME] >= m->next) {
        if (kind == ENDLESS) {
            made->again = true;
        } else {
            tick(m, made);
        }
    }
    if (m->clock != 0) {
        end_tick(m, made);
    }
    m->settled = true;
    made->has_next = m->next < (double)INFINITY;
    return ANSWER_OK;
}

bool exchanged_set_d(exchanged *m, int d)
{
    m->d = d;
    return m->mode != CONTINUOUS; /* a discrete input changes in event mode alone */
}

bool exchanged_set_real(exchanged *m, unsigned reference, double value)
{
    const bool is_open = m->mode != CONTINUOUS || reference == U;
    if (reference >= REALS || !is_open) {
        return false;
    }
    m->real[reference] = value;
    return true;
}

double exchanged_slope(const exchanged *m)
{
    switch (kind_of(m)) {
    case FALLING: return 1.0 / m->real[AT];
    case PENDULUM: return cos(m->real[X]);
    case SHORT_RATES: return 2.0;
    default: return 1.0;
    }
}

double exchanged_real(const exchanged *m, unsigned reference)
{
    if (kind_of(m) == CAM && (reference == TIP || reference == TIP_RATE)) {
        return reference == TIP ? cam_lift(m) : cam_slope(m) * m->real[V];
    }
    if (reference == TIP || reference == TIP_RATE) {
        return reference == TIP ? sin(m->real[X]) : cos(m->real[X]) * m->real[V];
    }
    return reference < REALS ? m->real[reference] : (double)NAN;
}
