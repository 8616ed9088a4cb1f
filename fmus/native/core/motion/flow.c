#include "motion/flow.h"

#include <math.h>

#include "motion/magnitude.h"
#include "motion/mode_series.h"

/* Largest steady response that is split off, in units of the motion; above, the split loses too many digits. */
static const double LARGEST_SPLIT = 8.0;
/* Length of an overdamped segment, in units of 1 / fastest rate, above which a series costs too much. The steady
 * response may then be LARGEST_SPLIT_OVERDAMPED motions: its error, 1e-16 of it, is a time error of 1e-16 of the slow
 * decay time. */
static const double LONGEST_SERIES = 1e4;
static const double LARGEST_SPLIT_OVERDAMPED = 1e10;

/* stiffness/mass - (damping/(2 mass))^2 without cancellation: 0 exactly at critical damping. */
static double discriminant(double mass, double damping, double stiffness)
{
    const double square = damping * damping;
    const double square_error = fma(damping, damping, -square);
    const double product = 4.0 * stiffness * mass;
    const double product_error = fma(4.0 * stiffness, mass, -product);
    return ((product - square) + (product_error - square_error)) / (4.0 * mass * mass);
}

/* stiffness - w^2 without cancellation. */
static inline double detuning_of(const vi_mode *mode, double w)
{
    return mode->stiffness < 0.0 ? mode->stiffness - w * w : (mode->natural - w) * (mode->natural + w);
}

/* Steady response to force cos(phase), as a multiple of the cosine and of the sine, and its amplitude. Returns whether
 * it exists and is not 0. */
static bool respond(const vi_mode *mode, double force, double w, double *cosine, double *sine, double *amplitude)
{
    const double detuning = detuning_of(mode, w);
    const double drag = 2.0 * mode->decay * w;
    const double size = vi_magnitude(detuning, drag);
    *cosine = *sine = *amplitude = 0.0;
    if (!(size > 0.0 && force != 0.0)) {
        return false;
    }
    *cosine = force * (detuning / size) / size;
    *sine = force * (drag / size) / size;
    *amplitude = fabs(force) / size;
    return isfinite(*amplitude);
}

static void start_steady(vi_mode *mode)
{
    double w = mode->angular_frequency;
    const bool exists =
        respond(mode, mode->force, w, &mode->steady_cos, &mode->steady_sin, &mode->steady_amplitude);
    mode->steady_exists = mode->force == 0.0 || exists;
    mode->steady_snap = w * w * w * w * mode->steady_amplitude;
    mode->force_size = fabs(mode->force);
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        vi_further *sine = &mode->further[k];
        double amplitude;
        w = sine->angular_frequency;
        const bool one = respond(mode, sine->force, w, &sine->cosine, &sine->sine, &amplitude);
        mode->steady_exists = mode->steady_exists && (sine->force == 0.0 || one);
        mode->steady_amplitude += amplitude;
        mode->force_size += fabs(sine->force);
        mode->steady_snap += w * w * w * w * amplitude;
    }
}

void vi_mode_drive(vi_mode *mode, double force, double angular_frequency)
{
    mode->force = force;
    mode->angular_frequency = angular_frequency;
    mode->fastest = fmax(fmax(mode->natural, 2.0 * fabs(mode->decay)), angular_frequency);
    if (mode->stiffness < 0.0) {
        mode->fastest = fmax(mode->fastest, fmax(mode->fast, -mode->slow));
    }
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        mode->fastest = fmax(mode->fastest, mode->further[k].angular_frequency);
    }
    start_steady(mode);
}

void vi_mode_drive_further(vi_mode *mode, int sines, const double force[], const double angular_frequency[])
{
    mode->sines = sines;
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        mode->further[k] = (vi_further){.force = force[k], .angular_frequency = angular_frequency[k]};
    }
    vi_mode_drive(mode, mode->force, mode->angular_frequency);
}

double vi_further_force(const vi_mode *mode, const vi_phase further[])
{
    double sum = 0.0;
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        sum += mode->further[k].force * further[k].cosine;
    }
    return sum;
}

/* Add the steady response to the further sines at these phases. */
static inline void add_further(const vi_mode *mode, const vi_phase further[], double *x, double *v)
{
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        const vi_further *sine = &mode->further[k];
        const double c = further[k].cosine, s = further[k].sine;
        *x += sine->cosine * c + sine->sine * s;
        *v += sine->angular_frequency * (sine->sine * c - sine->cosine * s);
    }
}

void vi_further_after(const vi_mode *mode, const vi_phase start[], double u, vi_phase end[])
{
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        end[k] = vi_phase_of(start[k].angle + mode->further[k].angular_frequency * u);
    }
}

/* The two rates of decay; the smaller is found from the larger one, without cancellation. */
static void find_rates(vi_mode *mode)
{
    mode->fast = mode->decay + mode->rate;
    mode->slow = mode->decay;
    if (mode->regime == VI_OVERDAMPED && mode->decay < 0.0) {
        mode->slow = mode->decay - mode->rate;
        mode->fast = mode->stiffness / mode->slow;
    } else if (mode->regime == VI_OVERDAMPED) {
        mode->slow = mode->stiffness / mode->fast;
    }
}

void vi_mode_start(vi_mode *mode, double mass, double damping, double stiffness, double amplitude,
                   double angular_frequency)
{
    mode->stiffness = stiffness / mass;
    mode->natural = sqrt(fabs(mode->stiffness));
    mode->decay = damping / (2.0 * mass);
    mode->growth = (stiffness < 0.0 ? mode->natural : 0.0) + (damping < 0.0 ? -2.0 * mode->decay : 0.0);
    const double d = discriminant(mass, damping, stiffness);
    mode->regime = d > 0.0 ? VI_UNDERDAMPED : d < 0.0 ? VI_OVERDAMPED : VI_CRITICAL;
    mode->rate = sqrt(fabs(d));
    find_rates(mode);
    mode->sines = 0;
    vi_mode_drive(mode, amplitude / mass, angular_frequency);
}

/* ---- homogeneous flow: e_cos = Ce, e_sin = Se of equations.md 1.2 and 1.9 ---- */

typedef struct {
    double e_sin;       /* Phi12 */
    double front, back; /* Phi11 and Phi22 */
    double slow, fast;  /* the two exponentials */
} propagator;

static propagator overdamped(const vi_mode *mode, double slow, double fast, double lost)
{
    propagator p = {.slow = slow, .fast = fast};
    const double e_cos = 0.5 * (slow + fast);
    p.e_sin = slow * (lost / (2.0 * mode->rate));
    /* far from critical damping Ce - |decay| Se cancels; near it the difference of the exponentials cancels */
    const bool far = mode->rate > 0.5 * fabs(mode->decay);
    p.front = mode->decay < 0.0 && far ? (mode->fast * slow - mode->slow * fast) / (2.0 * mode->rate)
                                       : e_cos + mode->decay * p.e_sin;
    p.back = mode->decay >= 0.0 && far ? (mode->fast * fast - mode->slow * slow) / (2.0 * mode->rate)
                                       : e_cos - mode->decay * p.e_sin;
    return p;
}

static inline propagator underdamped(const vi_mode *mode, double decay, double cosine, double sine)
{
    propagator p = {.slow = decay, .fast = decay};
    const double e_cos = decay * cosine;
    p.e_sin = decay * (sine / mode->rate);
    p.front = e_cos + mode->decay * p.e_sin;
    p.back = e_cos - mode->decay * p.e_sin;
    return p;
}

static inline propagator critical(const vi_mode *mode, double decay, double u)
{
    propagator p = {.slow = decay, .fast = decay};
    p.e_sin = decay * u;
    p.front = decay + mode->decay * p.e_sin;
    p.back = decay - mode->decay * p.e_sin;
    return p;
}

static inline propagator propagate(const vi_mode *mode, double u)
{
    if (mode->regime == VI_OVERDAMPED) {
        return overdamped(mode, exp(-mode->slow * u), exp(-mode->fast * u), -expm1(-2.0 * mode->rate * u));
    }
    const double decay = exp(-mode->decay * u);
    return mode->regime == VI_UNDERDAMPED ? underdamped(mode, decay, cos(mode->rate * u), sin(mode->rate * u))
                                          : critical(mode, decay, u);
}

static void take_rows(const vi_mode *mode, const propagator *p, double phi[4])
{
    phi[0] = p->front;
    phi[1] = p->e_sin;
    phi[2] = -mode->stiffness * p->e_sin;
    phi[3] = p->back;
}

void vi_mode_propagator(const vi_mode *mode, double u, double phi[4])
{
    const propagator p = propagate(mode, u);
    take_rows(mode, &p, phi);
}

void vi_mode_propagator_by(const vi_mode *mode, double u, const vi_mode_functions *functions, double phi[4])
{
    const vi_mode_functions *f = functions;
    const propagator p = mode->regime == VI_OVERDAMPED    ? overdamped(mode, f->slow, f->fast, f->lost)
                         : mode->regime == VI_UNDERDAMPED ? underdamped(mode, f->slow, f->cosine, f->sine)
                                                          : critical(mode, f->slow, u);
    take_rows(mode, &p, phi);
}

/* Propagator `u` seconds after the start of a segment whose motion is counted from an earlier instant. The phase angle
 * has twice the digits, so it is as exact after 10^6 periods as after one. */
static propagator propagate_from_before(const vi_segment *s, double u)
{
    const vi_mode *mode = s->mode;
    const double time = s->since + u, part = time - s->since;
    const double low = (s->since - (time - part)) + (u - part) + s->since_low;
    const double angle = mode->rate * time, rest = fma(mode->rate, time, -angle) + mode->rate * low;
    const double c = cos(angle), sn = sin(angle);
    propagator p;
    p.slow = p.fast = exp(-mode->decay * time);
    const double e_cos = p.slow * (c - rest * sn);
    p.e_sin = p.slow * ((sn + rest * c) / mode->rate);
    p.front = e_cos + mode->decay * p.e_sin;
    p.back = e_cos - mode->decay * p.e_sin;
    return p;
}

static inline propagator propagate_segment(const vi_segment *s, double u)
{
    return s->since > 0.0 ? propagate_from_before(s, u) : propagate(s->mode, u);
}

/* ---- the split form ---- */

/* Largest steady response that may be split off, m: a multiple of the displacements within the segment. */
static double largest_split(const vi_segment *s, double x, double v)
{
    const vi_mode *mode = s->mode;
    const double load = mode->force_size + fabs(s->held);
    if (mode->regime == VI_OVERDAMPED && mode->decay > 0.0 && mode->fastest * s->length > LONGEST_SERIES) {
        return LARGEST_SPLIT_OVERDAMPED * (fabs(x) + (fabs(v) + load * s->length) / mode->fast);
    }
    const double time = mode->fastest * s->length > 1.0 ? 1.0 / mode->fastest : s->length;
    return LARGEST_SPLIT * (fabs(x) + (fabs(v) + load * time) * time);
}

/* Find the particular solution of a load of higher degree; false when it is larger than `most` within the segment. */
static bool level_higher(vi_segment *s, double most)
{
    const vi_mode *mode = s->mode;
    const int degree = vi_segment_degree(s);
    double next = 0.0, after = 0.0, size = 0.0, power = s->length;
    for (int n = degree; n >= 0; --n) {
        const double order = (double)n + 1.0;
        const double load = n >= 2 ? s->higher[n - 2] : n == 1 ? s->held_rate : s->held;
        const double level = (load - order * (2.0 * mode->decay * next + (order + 1.0) * after)) / mode->stiffness;
        *(n >= 2 ? &s->level_higher[n - 2] : n == 1 ? &s->level_rate : &s->level) = level;
        after = next;
        next = level;
    }
    for (int n = 2; n <= degree; ++n) {
        power *= s->length;
        size += fabs(s->level_higher[n - 2]) * power;
    }
    return fabs(s->level) <= most && fabs(s->level_rate) * s->length <= most && size <= most;
}

/* Split off the steady response and the particular solution of the load; false when digits would be lost. */
static bool split(vi_segment *s, double x, double v)
{
    const vi_mode *mode = s->mode;
    const double most = largest_split(s, x, v);
    if (!mode->steady_exists || mode->steady_amplitude > most) {
        return false;
    }
    s->level = s->level_rate = 0.0;
    if (vi_segment_degree(s) > 1) {
        if (!level_higher(s, most)) {
            return false;
        }
    } else if (s->held != 0.0 || s->held_rate != 0.0) {
        s->level_rate = s->held_rate / mode->stiffness;
        s->level = (s->held - 2.0 * mode->decay * s->level_rate) / mode->stiffness;
        if (!(fabs(s->level) <= most && fabs(s->level_rate) * s->length <= most)) {
            return false;
        }
    }
    const double c = s->phase.cosine, sn = s->phase.sine;
    s->x = x - s->level - (mode->steady_cos * c + mode->steady_sin * sn);
    s->v = v - s->level_rate - mode->angular_frequency * (mode->steady_sin * c - mode->steady_cos * sn);
    if (vi_mode_sines(mode) > 0) {
        double steady = 0.0, rate = 0.0;
        add_further(mode, s->further, &steady, &rate);
        s->x -= steady;
        s->v -= rate;
    }
    return true;
}

static void bound_split(vi_segment *s)
{
    const vi_mode *mode = s->mode;
    const double turned = s->v + mode->decay * s->x;
    s->amplitude = s->slow_part = s->fast_part = 0.0;
    if (mode->regime == VI_UNDERDAMPED) {
        s->amplitude = sqrt(s->x * s->x + (turned / mode->rate) * (turned / mode->rate));
    } else if (mode->regime == VI_OVERDAMPED) {
        s->slow_part = fabs(s->v + mode->fast * s->x) / (2.0 * mode->rate);
        s->fast_part = fabs(s->v + mode->slow * s->x) / (2.0 * mode->rate);
    }
    s->scale = (vi_mode_grows(mode) ? s->swell * fabs(s->x) : fabs(s->x)) + mode->steady_amplitude + fabs(s->level)
               + fabs(s->level_rate) * s->length;
    double power = s->length;
    for (int n = 2; n <= vi_segment_degree(s); ++n) {
        power *= s->length;
        s->scale += fabs(s->level_higher[n - 2]) * power;
    }
}

/* Bound on the homogeneous |x''''| from the energy of the present state while this energy does not grow. */
static double energy_bound(const vi_mode *mode, double x, double v)
{
    const double damping = 2.0 * fabs(mode->decay), stiffness = fabs(mode->stiffness);
    const double energy = sqrt(v * v + stiffness * x * x);
    const double second = sqrt(damping * damping + stiffness) * energy;
    const double third = damping * second + stiffness * energy;
    return damping * third + stiffness * second;
}

/* Bound on the homogeneous |x''''| from here on, where nothing grows: equations.md 2.2, one order up. */
static inline double falling_bound(const vi_segment *s, double slow_left, double fast_left, double x, double v)
{
    const vi_mode *mode = s->mode;
    const double amplitude_bound = mode->stiffness * mode->stiffness * s->amplitude * slow_left;
    if (mode->regime == VI_UNDERDAMPED && mode->rate > 0.1 * mode->natural) {
        return amplitude_bound; /* tight away from critical damping */
    }
    const double energy = energy_bound(mode, x, v);
    if (mode->regime == VI_CRITICAL) {
        return energy;
    }
    const double slow = mode->slow * mode->slow, fast = mode->fast * mode->fast;
    const double parts = s->slow_part * slow_left * slow * slow + s->fast_part * fast_left * fast * fast;
    return fmin(energy, mode->regime == VI_UNDERDAMPED ? amplitude_bound : parts);
}

/* The same for all motions, up to twice the segment's length where they grow. */
static inline double homogeneous_bound(const vi_segment *s, double slow_left, double fast_left, double x, double v)
{
    const double bound = falling_bound(s, slow_left, fast_left, x, v);
    return vi_mode_grows(s->mode) ? s->swell * bound : bound;
}

static void split_at(const vi_segment *s, double u, vi_motion *m)
{
    const vi_mode *mode = s->mode;
    const double w = mode->angular_frequency;
    const propagator p = propagate_segment(s, u);
    const double x = p.front * s->x + p.e_sin * s->v;
    const double v = -mode->stiffness * p.e_sin * s->x + p.back * s->v;
    const double angle = s->phase.angle + w * u;
    const double c = cos(angle), sn = sin(angle);
    m->snap_bound = homogeneous_bound(s, p.slow, p.fast, x, v) + mode->steady_snap;
    m->x = x + (mode->steady_cos * c + mode->steady_sin * sn) + (s->level + s->level_rate * u);
    m->v = v + w * (mode->steady_sin * c - mode->steady_cos * sn) + s->level_rate;
    m->a = mode->force * c + (s->held + s->held_rate * u) - 2.0 * mode->decay * m->v - mode->stiffness * m->x;
    m->j = s->held_rate - mode->force * w * sn - 2.0 * mode->decay * m->a - mode->stiffness * m->v;
}

void vi_segment_part(const vi_segment *s, double u, vi_part *part)
{
    if (s->series) {
        vi_series_part(s, u, part);
        return;
    }
    const vi_mode *mode = s->mode;
    propagator p = {.slow = 1.0, .fast = 1.0};
    if (u == 0.0) {
        part->x = s->start;
        part->v = s->start_rate;
    } else {
        p = propagate_segment(s, u);
        part->x = p.front * s->x + p.e_sin * s->v;
        part->v = -mode->stiffness * p.e_sin * s->x + p.back * s->v;
    }
    part->a = -2.0 * mode->decay * part->v - mode->stiffness * part->x;
    part->j = -2.0 * mode->decay * part->a - mode->stiffness * part->v;
    part->snap_bound = homogeneous_bound(s, p.slow, p.fast, part->x, part->v);
    if (mode->regime == VI_UNDERDAMPED && mode->rate > 0.1 * mode->natural) {
        part->reach = s->amplitude * p.slow;
    } else {
        const double stiffness = fabs(mode->stiffness);
        part->reach = stiffness > 0.0 ? sqrt(part->x * part->x + part->v * part->v / stiffness) : HUGE_VAL;
    }
    if (vi_mode_grows(mode)) {
        part->reach *= s->swell;
    }
}

/* ---- segments ---- */

vi_phase vi_phase_of(double angle)
{
    return (vi_phase){angle, cos(angle), sin(angle)};
}

/* Set the members of mode j's segment that do not depend on its form. */
static void set_out(vi_segment *segment, const vi_mode *mode, const vi_drive *drive, int j, double length)
{
    segment->mode = mode;
    segment->origin = 0.0;
    segment->phase = drive->phase;
    segment->further = drive->further;
    segment->held = drive->held[j];
    segment->held_rate = drive->held_rate[j];
    segment->degree = drive->degree;
    for (int n = 2; n <= vi_segment_degree(segment); ++n) {
        segment->higher[n - 2] = drive->higher[n - 2][j];
    }
    segment->length = length;
    segment->since = segment->since_low = 0.0;
    segment->swell = vi_mode_grows(mode) ? exp(2.0 * mode->growth * length) : 1.0;
}

/* Choose the form of a segment whose other members are set. */
static void begin(vi_segment *segment, double x, double v, bool local)
{
    segment->series = local || !split(segment, x, v);
    if (segment->series) {
        vi_series_begin(segment, x, v);
    } else {
        segment->start = segment->x;
        segment->start_rate = segment->v;
        bound_split(segment);
    }
}

void vi_segment_start(vi_segment *segment, const vi_mode *mode, double x, double v, vi_phase phase, double held,
                      double held_rate, double length, bool local)
{
    const vi_drive drive = {.phase = phase, .held = &held, .held_rate = &held_rate, .degree = 1};
    set_out(segment, mode, &drive, 0, length);
    begin(segment, x, v, local);
}

void vi_segments_start(vi_segment segments[], const vi_mode modes[], int count, const double x[], const double v[],
                       const vi_drive *drive, double length)
{
    for (int j = 0; j < count; ++j) {
        set_out(&segments[j], &modes[j], drive, j, length);
        begin(&segments[j], x[j], v[j], false);
    }
}

void vi_segments_start_local(vi_segment segments[], const vi_mode modes[], int count, const double x[],
                             const double v[], const vi_drive *drive, double length)
{
    for (int j = 0; j < count; ++j) {
        set_out(&segments[j], &modes[j], drive, j, length);
        segments[j].series = true;
    }
    vi_series_begin_all(segments, count, x, v);
}

void vi_segment_continue(vi_segment *segment, double x, double v, double amplitude, double since, double since_low)
{
    segment->scale += fabs(x) - fabs(segment->x);
    segment->x = x;
    segment->v = v;
    segment->amplitude = amplitude;
    segment->since = since;
    segment->since_low = since_low;
}

void vi_segment_at(const vi_segment *segment, double u, vi_motion *motion)
{
    if (segment->series) {
        vi_series_at(segment, u, motion);
    } else {
        split_at(segment, u, motion);
    }
}

void vi_segment_end(const vi_segment *segment, double u, vi_phase phase, const vi_phase further[], double *x, double *v)
{
    if (segment->series) {
        vi_series_end(segment, u, x, v);
        return;
    }
    const vi_mode *mode = segment->mode;
    const double w = mode->angular_frequency, c = phase.cosine, sn = phase.sine;
    const propagator p = propagate_segment(segment, u);
    *x = p.front * segment->x + p.e_sin * segment->v
         + (mode->steady_cos * c + mode->steady_sin * sn) + (segment->level + segment->level_rate * u);
    *v = -mode->stiffness * p.e_sin * segment->x + p.back * segment->v
         + w * (mode->steady_sin * c - mode->steady_cos * sn) + segment->level_rate;
    if (vi_mode_sines(mode) > 0 || vi_segment_degree(segment) > 1) {
        vi_segment_add_further(segment, u, further, x, v);
    }
}

void vi_segment_add_further(const vi_segment *segment, double u, const vi_phase further[], double *x, double *v)
{
    add_further(segment->mode, further, x, v);
    if (vi_segment_degree(segment) > 1) {
        double value[4] = {0.0};
        vi_add_higher(segment->level_higher, vi_segment_degree(segment), u, value);
        *x += value[0];
        *v += value[1];
    }
}
