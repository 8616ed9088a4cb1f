#include "impact.h"

#include <float.h>
#include <math.h>

#include "majorant.h"

/* Chatter is summed only far down a sequence, so that its impacts are seen one by one before. */
static const double TAIL_VELOCITY = 1e-4;
/* Largest error of the summed time, in units of 1 / fastest rate. */
static const double TAIL_ERROR = 1e-16;
/* A bounce lower than this times the resolution of displacements cannot be followed: the body rests. */
static const double LOWEST_BOUNCE = 8.0;

double vi_body_resolution(const vi_body *body, double position)
{
    return DBL_EPSILON * (fabs(position) + body->mode.steady_amplitude);
}

/* The end of a chatter sequence that leaves the stop at speed `rebound`, pressed at acceleration `pressure`. */
typedef struct {
    double duration; /* s */
    double error;    /* estimate of the third-order term, s */
    bool complete;   /* the pressure lasts to the end */
} chatter_tail;

static chatter_tail sum_tail(const vi_body *body, double pressure, double slope, double rebound, double restitution)
{
    const vi_mode *mode = &body->mode;
    const double s = 2.0 * rebound / (pressure * (1.0 - restitution));
    const double drag = 2.0 * mode->decay;
    const double relative = (fabs(slope) / pressure + drag) * s;
    const double bend = fabs(mode->force) * mode->angular_frequency * mode->angular_frequency * s * s / pressure;
    chatter_tail tail;
    tail.duration = s - s * s / 3.0 * (slope / pressure + 0.5 * drag);
    tail.error = s * (relative * relative + bend);
    tail.complete = relative + bend < 0.25;
    return tail;
}

void vi_body_stick(vi_body *body, int k, double delay, double tail_impulse)
{
    vi_contact *contact = &body->contacts[k];
    body->stuck = k + 1;
    body->velocity = 0.0;
    body->tail_impulse = tail_impulse;
    body->fastest_impact = 0.0;
    contact->stuck = 1;
    contact->stick_start = vi_clock_time(&body->clock, vi_clock_after(&body->clock, body->now, delay));
    contact->stick_end = NAN;
}

/* Rest on stop k now if the bounces still to come can be summed (or are too low to be followed); `pressure` is the
 * acceleration towards the stop, `slope` its rate. */
static void rest_if_summable(vi_body *body, int k, double pressure, double slope, double rebound, double restitution)
{
    const vi_contact *contact = &body->contacts[k];
    if (!(pressure > 0.0)) {
        return;
    }
    const bool lowest =
        rebound * rebound <= 2.0 * pressure * LOWEST_BOUNCE * vi_body_resolution(body, contact->position);
    if (restitution == 1.0) {
        if (lowest) {
            vi_body_stick(body, k, 0.0, 0.0);
        }
        return;
    }
    const chatter_tail tail = sum_tail(body, pressure, slope, rebound, restitution);
    const double precise = body->mode.fastest > 0.0 ? TAIL_ERROR / body->mode.fastest : HUGE_VAL;
    if (tail.complete && (lowest || tail.error <= precise)) {
        const double impulse = body->mass * (1.0 + restitution) * rebound / (1.0 - restitution);
        vi_body_stick(body, k, fmax(0.0, tail.duration), impulse);
    }
}

/* Below this speed a touch cannot be told from a miss: the penetration it stands for is below the resolution. */
static double undecidable_velocity(const vi_body *body, int k, double acceleration)
{
    return sqrt(2.0 * fabs(acceleration) * vi_body_resolution(body, body->contacts[k].position));
}

void vi_body_impact(vi_body *body, int k, double approach, double restitution)
{
    vi_contact *contact = &body->contacts[k];
    const double sign = vi_contact_direction(contact->side), rebound = restitution * approach;
    double acceleration, slope;
    vi_mode_held(&body->mode, contact->position, vi_body_phase_now(body), vi_body_held_now(body), body->held_rate,
                 &acceleration, &slope);
    const bool graze = approach <= undecidable_velocity(body, k, acceleration);
    body->displacement = contact->position;
    body->velocity = -sign * rebound;
    if (graze) {
        contact->graze_count += 1;
    } else {
        contact->count += 1;
        contact->last_time = vi_clock_time(&body->clock, body->now);
        contact->last_phase = vi_clock_phase(&body->clock, body->now);
        contact->last_velocity = approach;
        contact->impulse = body->mass * (1.0 + restitution) * approach;
        vi_record_impact(&body->record, contact->last_time, contact->last_phase, approach, contact->impulse, k + 1,
                         restitution);
    }
    body->fastest_impact = fmax(body->fastest_impact, approach);
    if (rebound <= TAIL_VELOCITY * body->fastest_impact || graze) {
        rest_if_summable(body, k, sign * acceleration, sign * slope, rebound, restitution);
    }
}

void vi_body_follow_extrema(vi_body *body, const vi_segment *segment, double end)
{
    vi_motion m;
    double u = 0.0;
    vi_segment_first(segment, body->displacement, body->velocity, &m);
    vi_record_extend(&body->record, body->displacement);
    const double noise = 4.0 * DBL_EPSILON * (fabs(m.v) + segment->scale * segment->mode->fastest);
    double sign = m.v != 0.0 ? copysign(1.0, m.v) : copysign(1.0, m.a);
    while (u < end) {
        /* the velocity sign * v falls to zero as a clearance does */
        const double speed = fmax(0.0, sign * m.v), closing = -sign * m.a;
        if (closing > 0.0 && speed <= noise) {
            u = fmin(end, u + speed / closing);
            vi_segment_at(segment, u, &m);
            vi_record_extend(&body->record, segment->origin + m.x);
            m.v = 0.0;
            sign = -sign;
            continue;
        }
        const vi_approach state = {speed, closing, -sign * m.j, m.snap_bound, 0.0};
        const double step = vi_certified_step(&state, end - u);
        u = fmin(end, u + fmax(step, 1e-12 * end));
        vi_segment_at(segment, u, &m);
    }
}
