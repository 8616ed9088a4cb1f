#include "body/modal/modal_scan.h"

#include <math.h>
#include <string.h>

#include "motion/majorant.h"

/* The shortest step, in radians of the fastest rate. */
static const double SHORTEST_STEP = 0.05;
/* Rounding of samples, in units of the terms that displacements are sums of; contacts closer than that are not for
 * samples to tell. */
static const double ROUNDING = 1e-12;
/* Of a single mode, whose displacement is all there is to a chord, steps beyond .8 radians clear little. */
enum { LONGEST_OF_ONE = 4 };
/* Blocks of samples after which a scan ends where it is. */
enum { MOST_BLOCKS = 4096 };
enum { MOST_ITERATIONS = 8 };

/* ---- propagators ---- */

static void renew(vi_scan *scan, const vi_structure_model *model)
{
    bool same = scan->modes == vi_structure_modes(model) && scan->angular_frequency == model->clock.angular_frequency;
    for (int j = 0; j < vi_structure_modes(model) && same; ++j) {
        same = scan->stiffness[j] == model->mode[j].stiffness && scan->decay[j] == model->mode[j].decay;
    }
    if (same) {
        return;
    }
    scan->modes = vi_structure_modes(model);
    scan->angular_frequency = model->clock.angular_frequency;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        scan->stiffness[j] = model->mode[j].stiffness;
        scan->decay[j] = model->mode[j].decay;
    }
    for (int l = 0; l < VI_SCAN_LEVELS; ++l) {
        scan->level[l].step = 0.0;
    }
}

static double step_of(const vi_structure_model *model, int l)
{
    return SHORTEST_STEP / model->fastest * (double)(1 << l);
}

static void make(vi_scan_level *level, const vi_scan *scan, const vi_structure_model *model, int l)
{
    level->step = step_of(model, l);
    for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
        const double time = (double)(i + 1) * level->step;
        level->cosine[i] = cos(scan->angular_frequency * time);
        level->sine[i] = sin(scan->angular_frequency * time);
        for (int j = 0; j < vi_structure_modes(model); ++j) {
            double phi[4];
            vi_mode_propagator(&model->mode[j], time, phi);
            level->x_of_x[j][i] = phi[0];
            level->x_of_v[j][i] = phi[1];
            level->v_of_x[j][i] = phi[2];
            level->v_of_v[j][i] = phi[3];
        }
    }
}

/* ---- the scan ---- */

/* Bounds of the unforced part of a mode. */
typedef struct {
    double reach, rate, second, third; /* of the displacement and its derivatives */
} extent;

/* An instant that samples are counted from. */
typedef struct {
    double u, cosine, sine; /* s after the start; of the forcing phase */
    double x[VI_MODES], v[VI_MODES]; /* unforced parts */
} place;

typedef struct {
    const vi_flight *flight;
    const vi_point *points;
    const int *looked_for;
    int contacts;
    place at;
    bool begins; /* it is at the instant that the scan began with */
    vi_approach now[VI_PORTS]; /* of the contacts, there */
    extent extent[VI_MODES];
} scanner;

/* An underdamped mode swings within its amplitude; the energy of no mode grows. So bounds at the start of a flight hold
 * all along. */
static extent extent_of(const vi_segment *segment)
{
    const vi_mode *mode = segment->mode;
    const double x = segment->start, v = segment->start_rate;
    if (mode->regime == VI_UNDERDAMPED && mode->rate > 0.1 * mode->natural) {
        const double rate = mode->natural * segment->amplitude, second = mode->natural * rate;
        return (extent){segment->amplitude, rate, second, mode->natural * second};
    }
    const double damping = 2.0 * mode->decay, rate = sqrt(v * v + mode->stiffness * x * x);
    const double second = sqrt(damping * damping + mode->stiffness) * rate;
    const double reach = mode->natural > 0.0 ? rate / mode->natural : HUGE_VAL;
    return (extent){reach, rate, second, damping * second + mode->stiffness * rate};
}

/* How far the displacement of a point may lie off the chord between two samples. */
static double off_chord(const scanner *s, int k, double step)
{
    const double share = 0.125 * step * step, w = s->flight->angular_frequency;
    double sum = s->points[k].steady * vi_min(w * w * share, 2.0);
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        sum += fabs(s->points[k].shape[j]) * vi_min(s->extent[j].second * share, 2.0 * s->extent[j].reach);
    }
    return sum;
}

/* The same of its velocity. */
static double off_velocity_chord(const scanner *s, int k, double step)
{
    const double share = 0.125 * step * step, w = s->flight->angular_frequency;
    double sum = s->points[k].steady * w * vi_min(w * w * share, 2.0);
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        sum += fabs(s->points[k].shape[j]) * vi_min(s->extent[j].third * share, 2.0 * s->extent[j].rate);
    }
    return sum;
}

/* By how much acceleration may bring a contact that leaves its stop back within a step, m/s. */
static double speed_back(const vi_approach *p, double step)
{
    return vi_max(0.0, p->acceleration) * (0.5 * step) + vi_max(0.0, p->jerk) * (step * step / 6.0)
           + p->bound * (step * step * step / 24.0);
}

static double margin_of(const scanner *s, int k)
{
    return ROUNDING * s->points[k].scale;
}

/* Does the contact begin on its stop? */
static bool on_stop(const scanner *s, int k)
{
    return s->begins && s->now[k].clearance <= margin_of(s, k);
}

/* Does it look as if the first interval of this length were cleared, and the next? */
static bool is_worth(const scanner *s, double step)
{
    for (int k = 0; k < s->contacts; ++k) {
        if (!s->looked_for[k]) {
            continue;
        }
        const vi_approach *p = &s->now[k];
        const double left = on_stop(s, k) ? -(p->velocity + speed_back(p, step)) * step
                                          : p->clearance - vi_max(0.0, p->velocity) * step;
        if (!(left > off_chord(s, k, step) + margin_of(s, k))) {
            return false;
        }
    }
    return true;
}

/* The longest step that is worth a block of samples, no longer than that of `longest`; -1 where none is. */
static int level_for(const scanner *s, int longest)
{
    int l = longest;
    while (l >= 0 && !is_worth(s, step_of(s->flight->model, l))) {
        --l;
    }
    return l;
}

/* Clearances of a contact at all samples. */
static void sample(const scanner *s, const vi_scan_level *level, int k, double clearance[VI_SCAN_SAMPLES])
{
    const vi_point *point = &s->points[k];
    const place *at = &s->at;
    const double c = -point->sign * (point->cosine * at->cosine + point->sine * at->sine);
    const double n = -point->sign * (point->sine * at->cosine - point->cosine * at->sine);
    const double start = point->offset - point->sign * (point->level + point->level_rate * at->u);
    const double rise = -point->sign * point->level_rate * level->step;
    for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
        clearance[i] = start + (double)(i + 1) * rise + c * level->cosine[i] + n * level->sine[i];
    }
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        const double weight = -point->sign * point->shape[j], x = weight * at->x[j], v = weight * at->v[j];
        for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
            clearance[i] += x * level->x_of_x[j][i] + v * level->x_of_v[j][i];
        }
    }
}

/* Go on by 1 to VI_SCAN_SAMPLES steps. */
static void go(place *at, const vi_structure_model *model, const vi_scan_level *level, int steps)
{
    const int i = steps - 1;
    const double c = at->cosine * level->cosine[i] - at->sine * level->sine[i];
    at->sine = at->sine * level->cosine[i] + at->cosine * level->sine[i];
    at->cosine = c;
    at->u += (double)steps * level->step;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const double x = level->x_of_x[j][i] * at->x[j] + level->x_of_v[j][i] * at->v[j];
        at->v[j] = level->v_of_x[j][i] * at->x[j] + level->v_of_v[j][i] * at->v[j];
        at->x[j] = x;
    }
}

/* Clearance, speed and acceleration that a contact's stop sees. */
static vi_approach approach_at(const scanner *s, const place *at, int k)
{
    const vi_point *point = &s->points[k];
    const vi_structure_model *model = s->flight->model;
    const double w = s->flight->angular_frequency, square = w * w;
    const double forced = point->cosine * at->cosine + point->sine * at->sine;
    double x = forced + point->level + point->level_rate * at->u, a = -square * forced;
    double v = w * (point->sine * at->cosine - point->cosine * at->sine) + point->level_rate;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        x += point->shape[j] * at->x[j];
        v += point->shape[j] * at->v[j];
        a -= point->shape[j] * (2.0 * mode->decay * at->v[j] + mode->stiffness * at->x[j]);
    }
    return (vi_approach){point->offset - point->sign * x, point->sign * v, point->sign * a, 0.0, 0.0};
}

static void advance(scanner *s, const vi_scan_level *level, int steps)
{
    go(&s->at, s->flight->model, level, steps);
    s->begins = false;
    for (int k = 0; k < s->contacts; ++k) {
        if (s->looked_for[k]) {
            s->now[k] = approach_at(s, &s->at, k);
        }
    }
}

/* Intervals of a block, from its beginning on, that the chords clear. */
static int cleared(const scanner *s, const vi_scan_level *level)
{
    int least = VI_SCAN_SAMPLES;
    for (int k = 0; k < s->contacts; ++k) {
        if (!s->looked_for[k]) {
            continue;
        }
        double clearance[VI_SCAN_SAMPLES];
        const double enough = off_chord(s, k, level->step) + margin_of(s, k);
        const bool leaves = on_stop(s, k) && -s->now[k].velocity > speed_back(&s->now[k], level->step);
        bool free = s->now[k].clearance > enough;
        int i = 0;
        sample(s, level, k, clearance);
        if (leaves) {
            i = 1;
            free = clearance[0] > enough;
        }
        while (i < least && free && clearance[i] > enough) {
            ++i;
        }
        least = i < least ? i : least;
    }
    return least;
}

/* The zero, between two samples, of the polynomial of fifth order that has the clearances, speeds and accelerations of
 * both: a guess. */
static double guess(const vi_approach *a, const vi_approach *b, double step)
{
    const double d0 = a->clearance, d1 = -a->velocity * step, d2 = -0.5 * a->acceleration * step * step;
    const double e0 = b->clearance - d0 - d1 - d2, e1 = -b->velocity * step - d1 - 2.0 * d2;
    const double e2 = -0.5 * b->acceleration * step * step - d2;
    const double d3 = 10.0 * e0 - 4.0 * e1 + e2, d4 = -15.0 * e0 + 7.0 * e1 - 2.0 * e2, d5 = 6.0 * e0 - 3.0 * e1 + e2;
    double low = 0.0, high = 1.0, t = d0 / (d0 - b->clearance);
    for (int i = 0; i < MOST_ITERATIONS; ++i) {
        const double value = d0 + t * (d1 + t * (d2 + t * (d3 + t * (d4 + t * d5))));
        const double slope = d1 + t * (2.0 * d2 + t * (3.0 * d3 + t * (4.0 * d4 + t * (5.0 * d5))));
        *(value > 0.0 ? &low : &high) = t;
        double next = t - value / slope;
        if (!(next >= low && next <= high)) {
            next = 0.5 * (low + high);
        }
        if (fabs(next - t) < 1e-7) {
            return next * step;
        }
        t = next;
    }
    return t * step;
}

/* What becomes of an interval that the chords do not clear. */
typedef enum { CLEARED, HAS_CONTACT, UNDECIDED } verdict;

/* The interval of one step where the scan is, for one contact. */
static verdict judge(const scanner *s, const vi_scan_level *level, const place *end, int k, vi_scan_found *found)
{
    const vi_approach *a = &s->now[k], b = approach_at(s, end, k);
    const double margin = margin_of(s, k);
    if (vi_min(a->clearance, b.clearance) > off_chord(s, k, level->step) + margin) {
        return CLEARED;
    }
    if (!(a->clearance > margin) || !(vi_min(a->velocity, b.velocity) > off_velocity_chord(s, k, level->step))) {
        return UNDECIDED;
    }
    if (b.clearance < -margin) {
        found->contact = k;
        found->low = s->at.u;
        found->high = end->u;
        found->guess = s->at.u + guess(a, &b, level->step);
        return HAS_CONTACT;
    }
    return b.clearance > margin ? CLEARED : UNDECIDED;
}

/* The same for all contacts; of several that are met in it none is known to be the first. */
static verdict judge_all(const scanner *s, const vi_scan_level *level, vi_scan_found *found)
{
    verdict all = CLEARED;
    place end = s->at;
    go(&end, s->flight->model, level, 1);
    for (int k = 0; k < s->contacts; ++k) {
        const verdict one = s->looked_for[k] ? judge(s, level, &end, k, found) : CLEARED;
        if (one == UNDECIDED || (one == HAS_CONTACT && all == HAS_CONTACT)) {
            return UNDECIDED;
        }
        all = one == HAS_CONTACT ? one : all;
    }
    return all;
}

static void begin(scanner *s, const vi_flight_instant *from, const vi_approach first[])
{
    s->at.u = from->u;
    s->at.cosine = from->cosine;
    s->at.sine = from->sine;
    s->contacts = s->flight->model->contacts;
    s->begins = true;
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        s->at.x[j] = from->part[j].x;
        s->at.v[j] = from->part[j].v;
        s->extent[j] = extent_of(&s->flight->segment[j]);
    }
    for (int k = 0; k < s->contacts; ++k) {
        if (s->looked_for[k]) {
            s->now[k] = first[k];
        }
    }
}

vi_scan_end vi_scan_flight(vi_scan *scan, const vi_flight *flight, const vi_point points[], const int looked_for[],
                           const vi_flight_instant *from, const vi_approach first[], vi_scan_found *found)
{
    scanner s;
    s.flight = flight;
    s.points = points;
    s.looked_for = looked_for;
    renew(scan, flight->model);
    begin(&s, from, first);
    const int longest = vi_structure_modes(flight->model) == 1 ? LONGEST_OF_ONE : VI_SCAN_LEVELS - 1;
    int l = level_for(&s, longest);
    for (found->blocks = 0; found->blocks < MOST_BLOCKS && l >= 0; ++found->blocks) {
        vi_scan_level *level = &scan->level[l];
        if (level->step == 0.0) {
            make(level, scan, flight->model, l);
        }
        const int steps = cleared(&s, level);
        if (steps > 0) {
            advance(&s, level, steps);
        }
        found->low = s.at.u;
        if (s.at.u >= flight->length) {
            return VI_SCAN_CLEAR;
        }
        if (steps == VI_SCAN_SAMPLES) {
            l += l < longest && is_worth(&s, 2.0 * level->step);
            continue;
        }
        const verdict all = judge_all(&s, level, found);
        if (all == HAS_CONTACT) {
            return VI_SCAN_BRACKET;
        }
        if (all == CLEARED) {
            advance(&s, level, 1);
        } else {
            l = level_for(&s, l - 1);
        }
    }
    found->low = s.at.u;
    return s.at.u >= flight->length ? VI_SCAN_CLEAR : VI_SCAN_STUCK;
}
