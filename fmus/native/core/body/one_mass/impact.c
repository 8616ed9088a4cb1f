#include "body/one_mass/impact.h"

#include <float.h>
#include <math.h>

#include "body/chatter.h"
#include "body/contact_events.h"
#include "body/landing.h"
#include "motion/majorant.h"

/* Length of a bounce, in periods, below which it is tiny where there is no spring. */
static const double SHORT_FALL = 1e-12;
/* The steady response counts in the resolution up to this multiple of what the force does within one radian. */
static const double LARGEST_STEADY = 8.0;

/* Size of the displacements that make up a motion at a stop, m. */
static double displacement_size(const vi_body *body, double position)
{
    const vi_mode *mode = &body->mode;
    if (mode->natural == 0.0) {
        return fabs(position);
    }
    const double most = LARGEST_STEADY * fabs(mode->force) / (mode->fastest * mode->fastest);
    return fabs(position) + vi_min(most, mode->steady_amplitude);
}

/* Size of displacements that double precision cannot tell apart at a contact, m. Low bounces are followed from the
 * stop: of the motion only the stop's position is rounded. */
static double resolution(const vi_body *body, double position, double pressure, double approach)
{
    const bool low = vi_chatter_is_low(pressure, approach, body->mode.fastest);
    return DBL_EPSILON * (low ? fabs(position) : displacement_size(body, position));
}

void vi_body_stick(vi_body *body, int k, double delay, double tail_impulse)
{
    body->budget.events += 1;
    body->stuck = k + 1;
    body->velocity = 0.0;
    body->tail_impulse = tail_impulse;
    body->contacts[k].total_impulse += tail_impulse;
    body->fastest_impact = 0.0;
    body->low_impacts = 0;
    vi_contact_stick(&body->contacts[k], &body->clock, body->now, delay);
}

static bool is_tiny(const vi_body *body, double position, double pressure, double rebound)
{
    const vi_mode *mode = &body->mode;
    const double height = VI_LOW_HEIGHT * displacement_size(body, position);
    const double flight = mode->natural > 0.0 ? VI_SHORT_FLIGHT / mode->fastest : SHORT_FALL * body->clock.period;
    return rebound * rebound <= 2.0 * pressure * height || 2.0 * rebound <= flight * pressure;
}

/* Rest on stop k now if the bounces still to come can be summed (or are too low, or too many, to be followed). */
static void rest_if_summable(vi_body *body, int k, const vi_bounces *b)
{
    if (b->rebound == 0.0 && b->slope >= 0.0
        && fabs(b->pressure) <= vi_body_pressure_noise(body, body->contacts[k].position)) {
        vi_body_stick(body, k, 0.0, 0.0); /* neither pressed nor lifted */
        return;
    }
    if (!(b->pressure > 0.0)) {
        return;
    }
    const vi_chatter chatter = vi_chatter_look(b, body->low_impacts);
    if (chatter.rests) {
        const double impulse = body->mass * (1.0 + b->restitution) * b->rebound / (1.0 - b->restitution);
        vi_body_stick(body, k, chatter.duration, chatter.summed ? impulse : 0.0);
    }
}

/* The bounces that follow an impact on stop k. */
static vi_bounces bounces_after(const vi_body *body, int k, double approach, double rebound, double restitution)
{
    const vi_mode *mode = &body->mode;
    const double position = body->contacts[k].position, sign = vi_body_direction(body, k);
    double acceleration, slope;
    vi_mode_held(mode, position, vi_body_phase_now(body), vi_body_held_now(body), body->held_rate, &acceleration,
                 &slope);
    const double pressure = sign * acceleration;
    return (vi_bounces){.rebound = rebound,
                        .restitution = restitution,
                        .pressure = pressure,
                        .slope = sign * slope,
                        .bend = fabs(mode->force) * mode->angular_frequency * mode->angular_frequency,
                        .drag = 2.0 * mode->decay,
                        .fastest = mode->fastest,
                        .resolution = resolution(body, position, pressure, approach),
                        .tiny = is_tiny(body, position, pressure, rebound)};
}

void vi_body_impact(vi_body *body, int k, double approach, double restitution)
{
    vi_contact *contact = &body->contacts[k];
    const double rebound = restitution * approach;
    const vi_bounces b = bounces_after(body, k, approach, rebound, restitution);
    const bool graze = vi_chatter_is_graze(approach, b.pressure, b.resolution);
    body->budget.events += 1;
    body->displacement = contact->position;
    body->velocity = -vi_body_direction(body, k) * rebound;
    if (graze) {
        contact->graze_count += 1;
    } else {
        vi_contact_hit(contact, &body->record, &body->clock, body->now, k + 1, approach,
                       body->mass * (1.0 + restitution) * approach, restitution);
    }
    if (vi_chatter_count(&body->fastest_impact, &body->low_impacts, approach, rebound, graze, b.tiny)) {
        rest_if_summable(body, k, &b);
    }
}

void vi_body_follow_extrema(vi_body *body, const vi_segment *segment, double end)
{
    vi_motion m;
    double u = 0.0;
    vi_segment_first(segment, body->displacement, body->velocity, &m);
    vi_record_extend(&body->record, body->displacement);
    const double noise = VI_ROUNDING * (fabs(m.v) + segment->scale * segment->mode->fastest);
    double sign = m.v != 0.0 ? copysign(1.0, m.v) : copysign(1.0, m.a);
    for (int evaluation = 0; u < end; ++evaluation) {
        /* the velocity sign * v falls to zero as a clearance does */
        const double speed = fmax(0.0, sign * m.v), closing = -sign * m.a;
        if (closing > 0.0 && speed <= noise) {
            u = fmin(end, u + speed / closing);
            vi_segment_at(segment, u, &m);
            vi_record_extend(&body->record, vi_body_within(body, segment->origin + m.x));
            m.v = 0.0;
            sign = -sign;
            continue;
        }
        const vi_approach state = {speed, closing, -sign * m.j, m.snap_bound, 0.0};
        const double step = vi_certified_step(&state, end - u);
        u = fmin(end, u + fmax(step, vi_least_step(end, 1e-12, evaluation)));
        vi_segment_at(segment, u, &m);
        vi_budget_spend(&body->budget, 1);
    }
}
