#include "body/one_mass/impact.h"

#include <float.h>
#include <math.h>

#include "motion/majorant.h"

/* Chatter is summed only far down a sequence, so that its impacts are seen one by one before. */
static const double TAIL_VELOCITY = 1e-4;
/* Largest error of the summed time, in units of 1 / fastest rate. */
static const double TAIL_ERROR = 1e-16;
/* A bounce lower than this times the resolution of displacements cannot be followed: the body rests. */
static const double LOWEST_BOUNCE = 8.0;
/* After so many low impacts in a row the body rests: only restitution (almost) 1 gets there, whose chatter has no end
 * (or none in reach). Low: far down a sequence; or not higher than this times its displacements; or this short, in
 * radians of the fastest rate, or in periods where there is no spring. */
static const int64_t MOST_LOW_IMPACTS = 4000000;
static const double LOW_HEIGHT = 1e-10;
static const double SHORT_FLIGHT = 1e-7, SHORT_FALL = 1e-12;
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
    const bool low = pressure > 0.0 && 2.0 * approach * body->mode.fastest < VI_LOW_BOUNCE * pressure;
    return DBL_EPSILON * (low ? fabs(position) : displacement_size(body, position));
}

double vi_body_pressure_noise(const vi_body *body, double position)
{
    return 4.0 * DBL_EPSILON
           * (fabs(body->mode.force) + fabs(vi_body_held_now(body)) + body->mode.stiffness * fabs(position));
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
    /* 3.1 to second order in s; for r near 1, where s is long, drag g = 2 decay turns it into ln(1 + g s/3)/(g/3) */
    const double dragged = drag * s / 3.0;
    tail.duration = (dragged > 0.0 ? s * (log1p(dragged) / dragged) : s) - s * s / 3.0 * (slope / pressure);
    tail.error = s * (relative * relative + bend);
    tail.complete = relative + bend < 0.25;
    return tail;
}

void vi_body_stick(vi_body *body, int k, double delay, double tail_impulse)
{
    vi_contact *contact = &body->contacts[k];
    body->budget.events += 1;
    body->stuck = k + 1;
    body->velocity = 0.0;
    body->tail_impulse = tail_impulse;
    body->fastest_impact = 0.0;
    body->low_impacts = 0;
    contact->stuck = 1;
    contact->stick_start = vi_clock_time(&body->clock, vi_clock_after(&body->clock, body->now, delay));
    contact->stick_end = NAN;
}

/* The moment of an impact or graze. */
typedef struct {
    double pressure, slope; /* acceleration towards the stop of the body held there, m/s^2, and its rate */
    double rebound;         /* speed after it, m/s */
    double restitution;
    double resolution; /* of displacements, m */
    bool tiny;         /* the bounce that follows */
} touch;

static bool is_tiny(const vi_body *body, double position, double pressure, double rebound)
{
    const vi_mode *mode = &body->mode;
    const double height = LOW_HEIGHT * displacement_size(body, position);
    const double flight = mode->natural > 0.0 ? SHORT_FLIGHT / mode->fastest : SHORT_FALL * body->clock.period;
    return rebound * rebound <= 2.0 * pressure * height || 2.0 * rebound <= flight * pressure;
}

/* Rest on stop k now if the bounces still to come can be summed (or are too low, or too many, to be followed). */
static void rest_if_summable(vi_body *body, int k, const touch *t)
{
    if (t->rebound == 0.0 && t->slope >= 0.0
        && fabs(t->pressure) <= vi_body_pressure_noise(body, body->contacts[k].position)) {
        vi_body_stick(body, k, 0.0, 0.0); /* neither pressed nor lifted */
        return;
    }
    if (!(t->pressure > 0.0)) {
        return;
    }
    const bool lowest = t->rebound * t->rebound <= 2.0 * t->pressure * LOWEST_BOUNCE * t->resolution;
    const bool loses = t->restitution < 1.0 || body->mode.decay > 0.0;
    const bool endless = body->low_impacts > MOST_LOW_IMPACTS && (loses || t->tiny);
    if (t->restitution < 1.0) {
        const chatter_tail tail = sum_tail(body, t->pressure, t->slope, t->rebound, t->restitution);
        const double precise = body->mode.fastest > 0.0 ? TAIL_ERROR / body->mode.fastest : HUGE_VAL;
        if (tail.complete && (lowest || endless || tail.error <= precise)) {
            const double impulse = body->mass * (1.0 + t->restitution) * t->rebound / (1.0 - t->restitution);
            vi_body_stick(body, k, fmax(0.0, tail.duration), impulse);
            return;
        }
    }
    if (endless || (lowest && t->restitution == 1.0)) {
        vi_body_stick(body, k, 0.0, 0.0);
    }
}

static void count_impact(vi_body *body, int k, double approach, double restitution)
{
    vi_contact *contact = &body->contacts[k];
    contact->count += 1;
    contact->last_time = vi_clock_time(&body->clock, body->now);
    contact->last_phase = vi_clock_phase(&body->clock, body->now);
    contact->last_velocity = approach;
    contact->impulse = body->mass * (1.0 + restitution) * approach;
    vi_record_impact(&body->record, contact->last_time, contact->last_phase, approach, contact->impulse, k + 1,
                     restitution);
}

void vi_body_impact(vi_body *body, int k, double approach, double restitution)
{
    vi_contact *contact = &body->contacts[k];
    const double sign = vi_contact_direction(contact->side), rebound = restitution * approach;
    double acceleration, slope;
    vi_mode_held(&body->mode, contact->position, vi_body_phase_now(body), vi_body_held_now(body), body->held_rate,
                 &acceleration, &slope);
    const touch t = {sign * acceleration, sign * slope, rebound, restitution,
                     resolution(body, contact->position, sign * acceleration, approach),
                     is_tiny(body, contact->position, sign * acceleration, rebound)};
    /* below this speed a touch cannot be told from a miss: it stands for less penetration than can be resolved */
    const bool graze = approach * approach <= 2.0 * fabs(acceleration) * t.resolution;
    body->budget.events += 1;
    body->displacement = contact->position;
    body->velocity = -sign * rebound;
    if (graze) {
        contact->graze_count += 1;
    } else {
        count_impact(body, k, approach, restitution);
    }
    body->fastest_impact = vi_max(body->fastest_impact, approach);
    const bool far_down = rebound <= TAIL_VELOCITY * body->fastest_impact || graze;
    body->low_impacts = far_down || t.tiny ? body->low_impacts + 1 : 0;
    if (far_down || body->low_impacts > MOST_LOW_IMPACTS) {
        rest_if_summable(body, k, &t);
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
