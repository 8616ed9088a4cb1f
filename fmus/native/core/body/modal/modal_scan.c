#include "body/modal/modal_scan.h"

#include <math.h>

#include "motion/extent.h"
#include "motion/majorant.h"

/* Rounding of samples, relative to the sum of sizes of a displacement's terms. Less clearance is unresolved. */
static const double ROUNDING = 1e-12;
/* Longest level of steps for a single mode: steps beyond .8 radians clear little. Faster sines may be small, and do not
 * shorten it. */
enum { LONGEST_OF_ONE = 4 };
/* Most levels by which the steps grow from one block to the next. */
enum { STEEPEST_RISE = 3 };
/* Blocks of samples after which a scan ends where it is. */
enum { MOST_BLOCKS = 4096 };
enum { MOST_ITERATIONS = 8 };
/* Most halves of an interval with a contact, for a guess near enough that one evaluation is left. */
enum { MOST_HALVES = 3 };
static const double THIRD = 1.0 / 3.0, SIXTH = 1.0 / 6.0;
/* Newton step, in intervals between samples, below which a guess is good enough: its error is about the square. */
static const double CLOSE = 3e-4;

/* ---- the scan ---- */

/* Bounds of the unforced parts of all modes, at a contact. */
typedef struct {
    double reach[VI_MODES], rate[VI_MODES], fourth[VI_MODES];
} extents;

/* An instant from which samples are counted. */
typedef struct {
    double u, cosine, sine; /* s after the start; of the clock's phase */
    double further_cosine[VI_SINES_ROOM], further_sine[VI_SINES_ROOM];
    double x[VI_MODES], v[VI_MODES]; /* unforced parts */
} place;

typedef struct {
    const vi_scan *scan;
    const vi_flight *flight;
    const vi_point *points;
    const int *looked_for;
    int contacts;
    place at;
    bool begins; /* at the instant at which the scan began */
    vi_approach now[VI_PORTS]; /* of the contacts, at this instant */
    extents extent[VI_PORTS];  /* of the contacts */
} scanner;

static void take_extents(scanner *s, int k)
{
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        const double shape = fabs(s->points[k].shape[j]);
        const vi_extent e = shape > 0.0 ? vi_extent_of(&s->flight->segment[j]) : (vi_extent){0.0, 0.0, 0.0};
        s->extent[k].reach[j] = shape * e.reach;
        s->extent[k].rate[j] = shape * e.rate;
        s->extent[k].fourth[j] = shape * e.fourth;
    }
}

/* ---- uncertainty between samples ---- */

/* Uncertainty of a contact's clearance and of its rate between two samples. */
typedef struct {
    double off_cubic; /* deviation from the cubic with the values and rates of both samples */
    double ripple;    /* size of the rippling modes, which samples leave out */
    double rate;      /* deviation from the cubic's rate, ripples included, times a third of the step */
} opening;

/* Largest deviation from the cubic with the values and rates at both ends of a step h: SHARE_OF_FOURTH h^4 bound. The
 * rate's deviation times h/3 is less than SHARE_OF_RATE times as large. bound: of the fourth derivative. */
static const double SHARE_OF_FOURTH = 1.0 / 384.0, SHARE_OF_RATE = 1.0265;

/* Is a motion within `reach` left out of samples, because its cubic would be no better? */
static bool ripples(double fourth, double share, double reach)
{
    return fourth * share >= reach;
}

static opening opening_of(const scanner *s, int k, double step)
{
    const vi_point *point = &s->points[k];
    const double w = s->flight->angular_frequency, square = step * step, share = SHARE_OF_FOURTH * square * square;
    opening o = {0.0, 0.0, 0.0};
    double speed = 0.0;
    if (ripples(w * w * w * w, share, 1.0)) {
        o.ripple = point->steady;
        speed = point->steady * w;
    } else {
        o.off_cubic = point->steady * (w * w * w * w * share);
    }
    for (int n = 0; n < s->flight->sines; ++n) {
        const vi_point_sine *sine = &point->further[n];
        if (ripples(sine->fourth, share, 1.0)) {
            o.ripple += sine->amplitude;
            speed += sine->amplitude * sine->angular_frequency;
        } else {
            o.off_cubic += sine->amplitude * (sine->fourth * share);
        }
    }
    o.off_cubic += vi_flight_degree(s->flight) > 1 ? point->higher_snap * share : 0.0;
    const extents *e = &s->extent[k];
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        if (ripples(e->fourth[j], share, e->reach[j])) {
            o.ripple += e->reach[j];
            speed += e->rate[j];
        } else {
            o.off_cubic += e->fourth[j] * share;
        }
    }
    o.rate = SHARE_OF_RATE * o.off_cubic + speed * (step * THIRD);
    o.ripple += ROUNDING * point->scale;
    return o;
}

/* Largest speed by which acceleration may bring a contact that leaves its stop back within a step, m/s. */
static double speed_back(const vi_approach *p, double step)
{
    return vi_max(0.0, p->acceleration) * (0.5 * step) + vi_max(0.0, p->jerk) * (step * step * SIXTH)
           + p->bound * (step * step * step * (0.25 * SIXTH));
}

/* Does contact k begin on its stop? */
static bool on_stop(const scanner *s, int k)
{
    return s->begins && s->now[k].clearance <= ROUNDING * s->points[k].scale;
}

/* Are the first two intervals of this length likely to be cleared? */
static bool is_worth(const scanner *s, double step)
{
    for (int k = 0; k < s->contacts; ++k) {
        if (!s->looked_for[k]) {
            continue;
        }
        const vi_approach *p = &s->now[k];
        const opening o = opening_of(s, k, step);
        const double left = on_stop(s, k) ? -(p->velocity + speed_back(p, step)) * step
                                          : p->clearance - vi_max(0.0, p->velocity) * step;
        if (!(left > o.off_cubic + 2.0 * o.ripple)) {
            return false;
        }
    }
    return true;
}

/* The longest step that is worth a block of samples, from `longest` down to `shortest`; `shortest` if none is. */
static int level_between(const scanner *s, int shortest, int longest)
{
    int l = longest;
    while (l > shortest && !is_worth(s, vi_scan_step(s->scan, l))) {
        --l;
    }
    return l;
}

/* ---- samples ---- */

/* Samples of one contact at the scan's instant and after 1 to VI_SCAN_SAMPLES steps, without rippling modes. third:
 * rate of the clearance times a third of the step. */
typedef struct {
    double clearance[VI_SCAN_SAMPLES + 1], third[VI_SCAN_SAMPLES + 1];
} samples;

/* Add the response to the further sines, without those that ripple, and to loads of higher degree. */
static void sample_further(const scanner *s, const vi_scan_level *level, int k, samples *out)
{
    const vi_point *point = &s->points[k];
    const double square = level->step * level->step, share = SHARE_OF_FOURTH * square * square;
    const double part = level->step * THIRD;
    for (int n = 0; n < s->flight->sines; ++n) {
        const vi_point_sine *sine = &point->further[n];
        const double w = sine->angular_frequency;
        if (ripples(sine->fourth, share, 1.0)) {
            continue;
        }
        const double x = -point->sign * (sine->cosine * s->at.further_cosine[n] + sine->sine * s->at.further_sine[n]);
        const double y = -point->sign * (sine->sine * s->at.further_cosine[n] - sine->cosine * s->at.further_sine[n]);
        out->clearance[0] += x;
        out->third[0] += part * w * y;
        for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
            const double c = level->further_cosine[n][i], e = level->further_sine[n][i];
            out->clearance[i + 1] += x * c + y * e;
            out->third[i + 1] += part * w * (y * c - x * e);
        }
    }
    for (int i = 0; i <= VI_SCAN_SAMPLES && vi_flight_degree(s->flight) > 1; ++i) {
        double value[4] = {0.0};
        vi_add_higher(point->higher, vi_flight_degree(s->flight), s->at.u + (double)i * level->step, value);
        out->clearance[i] -= point->sign * value[0];
        out->third[i] -= point->sign * part * value[1];
    }
}

static void sample(const scanner *s, const vi_scan_level *level, int k, samples *out)
{
    const vi_point *point = &s->points[k];
    const place *at = &s->at;
    const double w = s->flight->angular_frequency, square = level->step * level->step;
    const double share = SHARE_OF_FOURTH * square * square, part = level->step * THIRD;
    const double start = point->offset - point->sign * (point->level + point->level_rate * at->u);
    const double rise = -point->sign * point->level_rate * level->step, third_of_rise = rise * THIRD;
    double c = 0.0, n = 0.0;
    if (!ripples(w * w * w * w, share, 1.0)) {
        c = -point->sign * (point->cosine * at->cosine + point->sine * at->sine);
        n = -point->sign * (point->sine * at->cosine - point->cosine * at->sine);
    }
    const double cw = part * w * c, nw = part * w * n;
    double *restrict clearance = out->clearance + 1, *restrict third = out->third + 1;
    out->clearance[0] = start + c;
    out->third[0] = third_of_rise + nw;
    for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
        clearance[i] = start + (double)(i + 1) * rise + c * level->cosine[i] + n * level->sine[i];
        third[i] = third_of_rise + nw * level->cosine[i] - cw * level->sine[i];
    }
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        if (ripples(s->extent[k].fourth[j], share, s->extent[k].reach[j])) {
            continue;
        }
        const double weight = -point->sign * point->shape[j], x = weight * at->x[j], v = weight * at->v[j];
        const double xw = part * x, vw = part * v;
        out->clearance[0] += x;
        out->third[0] += vw;
        for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
            clearance[i] += x * level->x_of_x[j][i] + v * level->x_of_v[j][i];
            third[i] += xw * level->v_of_x[j][i] + vw * level->v_of_v[j][i];
        }
    }
    if (s->flight->sines > 0 || vi_flight_degree(s->flight) > 1) {
        sample_further(s, level, k, out);
    }
}

/* Verdict on an interval between two samples. */
typedef enum { CLEARED, HAS_CONTACT, UNDECIDED } verdict;

/* Verdict on an interval that the cubic does not clear: a contact if the body surely comes closer throughout. */
static verdict judge(const samples *at, const opening *o, int i, bool is_off)
{
    const double first = at->third[i], last = at->third[i + 1];
    const double middle = (at->clearance[i + 1] - last) - (at->clearance[i] + first);
    if (!is_off || !(vi_max(vi_max(first, last), middle) < -o->rate)) {
        return UNDECIDED;
    }
    if (at->clearance[i + 1] < -o->ripple) {
        return HAS_CONTACT;
    }
    return at->clearance[i + 1] > o->ripple ? CLEARED : UNDECIDED;
}

/* Number of first intervals of a block that are cleared for one contact; *next: verdict on the next interval. */
static int cleared_of(const scanner *s, const vi_scan_level *level, int k, verdict *next)
{
    samples at;
    double lowest[VI_SCAN_SAMPLES]; /* of the cubic's control points; the cubic lies in their hull */
    const opening o = opening_of(s, k, level->step);
    const double enough = o.off_cubic + o.ripple;
    sample(s, level, k, &at);
    for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
        lowest[i] = vi_min(vi_min(at.clearance[i], at.clearance[i + 1]),
                           vi_min(at.clearance[i] + at.third[i], at.clearance[i + 1] - at.third[i + 1]));
    }
    int i = on_stop(s, k) && -s->now[k].velocity > speed_back(&s->now[k], level->step);
    *next = CLEARED;
    for (; i < VI_SCAN_SAMPLES; ++i) {
        if (lowest[i] > enough) {
            continue;
        }
        const bool is_off = i == 0 && s->begins ? !on_stop(s, k) : at.clearance[i] > o.ripple;
        *next = judge(&at, &o, i, is_off);
        if (*next != CLEARED) {
            break;
        }
    }
    return i;
}

/* Number of intervals cleared for all contacts. Of several contacts in one interval none is known to be first. */
static int cleared(const scanner *s, const vi_scan_level *level, verdict *next, int *contact)
{
    int least = VI_SCAN_SAMPLES;
    *next = CLEARED;
    for (int k = 0; k < s->contacts; ++k) {
        if (!s->looked_for[k]) {
            continue;
        }
        verdict one;
        const int count = cleared_of(s, level, k, &one);
        if (count < least) {
            *next = one;
            *contact = k;
        } else if (count == least && one != CLEARED) {
            *next = UNDECIDED;
        }
        least = count < least ? count : least;
    }
    return least;
}

/* The longest level of steps. The bounds of growing motions, and of polynomials, hold for twice the flight. */
static int longest_level(const vi_scan *scan, const vi_flight *flight)
{
    const double growing = vi_structure_grows(flight->model) ? 1.0 : 0.0;
    const double samples = vi_flight_degree(flight) > 1 ? (double)VI_SCAN_SAMPLES : growing;
    int l = vi_structure_modes(flight->model) == 1 && LONGEST_OF_ONE + scan->finer < VI_SCAN_LEVELS
                ? LONGEST_OF_ONE + scan->finer
                : VI_SCAN_LEVELS - 1;
    while (samples > 0.0 && l >= 0 && vi_scan_step(scan, l) * samples > flight->length) {
        --l;
    }
    return l;
}

/* ---- from sample to sample ---- */

/* Set the place 1 to VI_SCAN_SAMPLES steps after another, or after itself. */
static void go(place *to, const place *at, const vi_structure_model *model, const vi_scan_level *level, int steps)
{
    const int i = steps - 1;
    const double c = at->cosine * level->cosine[i] - at->sine * level->sine[i];
    to->sine = at->sine * level->cosine[i] + at->cosine * level->sine[i];
    to->cosine = c;
    for (int k = 0; k < vi_mode_sines(&model->mode[0]); ++k) {
        const double turned =
            at->further_cosine[k] * level->further_cosine[k][i] - at->further_sine[k] * level->further_sine[k][i];
        to->further_sine[k] =
            at->further_sine[k] * level->further_cosine[k][i] + at->further_cosine[k] * level->further_sine[k][i];
        to->further_cosine[k] = turned;
    }
    to->u = at->u + (double)steps * level->step;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const double x = level->x_of_x[j][i] * at->x[j] + level->x_of_v[j][i] * at->v[j];
        to->v[j] = level->v_of_x[j][i] * at->x[j] + level->v_of_v[j][i] * at->v[j];
        to->x[j] = x;
    }
}

/* Clearance, velocity and acceleration of a contact towards its stop. */
static vi_approach approach_at(const scanner *s, const place *at, int k)
{
    const vi_point *point = &s->points[k];
    const vi_structure_model *model = s->flight->model;
    const double w = s->flight->angular_frequency, square = w * w;
    const double forced = point->cosine * at->cosine + point->sine * at->sine;
    double x = forced + point->level + point->level_rate * at->u, a = -square * forced;
    double v = w * (point->sine * at->cosine - point->cosine * at->sine) + point->level_rate;
    for (int n = 0; n < s->flight->sines; ++n) {
        const vi_point_sine *sine = &point->further[n];
        const double f = sine->angular_frequency;
        const double steady = sine->cosine * at->further_cosine[n] + sine->sine * at->further_sine[n];
        x += steady;
        v += f * (sine->sine * at->further_cosine[n] - sine->cosine * at->further_sine[n]);
        a -= f * f * steady;
    }
    if (vi_flight_degree(s->flight) > 1) {
        double value[4] = {0.0};
        vi_add_higher(point->higher, vi_flight_degree(s->flight), at->u, value);
        x += value[0];
        v += value[1];
        a += value[2];
    }
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
    go(&s->at, &s->at, s->flight->model, level, steps);
    s->begins = false;
    for (int k = 0; k < s->contacts; ++k) {
        if (s->looked_for[k]) {
            s->now[k] = approach_at(s, &s->at, k);
        }
    }
}

/* Guess of the zero between two samples, by the quintic with the clearances, speeds and accelerations of both. */
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
        if (fabs(next - t) < CLOSE) {
            return next * step;
        }
        t = next;
    }
    return t * step;
}

/* An instant on either side of a contact. */
typedef struct {
    place at;
    vi_approach approach;
} side;

/* Bracket the contact in the interval after `steps` of level l. Fast sines, for which the quintic is rough, halve it. */
static void bracket(const scanner *s, vi_scan *scan, int l, int steps, int k, vi_scan_found *found)
{
    const vi_structure_model *model = s->flight->model;
    const vi_scan_level *level = vi_scan_level_of(scan, model, l);
    side sides[3], *low = &sides[0], *high = &sides[1], *middle = &sides[2];
    if (steps > 0) {
        go(&low->at, &s->at, model, level, steps);
        low->approach = approach_at(s, &low->at, k);
    } else {
        low->at = s->at;
        low->approach = s->now[k];
    }
    go(&high->at, &s->at, model, level, steps + 1);
    high->approach = approach_at(s, &high->at, k);
    for (int half = 0; half < scan->finer && half < MOST_HALVES && l > 0; ++half) {
        level = vi_scan_level_of(scan, model, --l);
        go(&middle->at, &low->at, model, level, 1);
        middle->approach = approach_at(s, &middle->at, k);
        side **const nearer = middle->approach.clearance > 0.0 ? &low : &high;
        side *const free = *nearer;
        *nearer = middle;
        middle = free;
    }
    const double u = low->at.u + guess(&low->approach, &high->approach, level->step);
    *found = (vi_scan_found){k, low->at.u, high->at.u, u, found->blocks};
}

static void begin(scanner *s, const vi_flight_instant *from, const vi_approach first[])
{
    s->at.u = from->u;
    s->at.cosine = from->cosine;
    s->at.sine = from->sine;
    for (int k = 0; k < s->flight->sines; ++k) {
        s->at.further_cosine[k] = from->further[k].cosine;
        s->at.further_sine[k] = from->further[k].sine;
    }
    s->contacts = s->flight->model->contacts;
    s->begins = true;
    for (int j = 0; j < vi_structure_modes(s->flight->model); ++j) {
        s->at.x[j] = from->part[j].x;
        s->at.v[j] = from->part[j].v;
    }
    for (int k = 0; k < s->contacts; ++k) {
        if (s->looked_for[k]) {
            s->now[k] = first[k];
            take_extents(s, k);
        }
    }
}

vi_scan_end vi_scan_flight(vi_scan *scan, const vi_flight *flight, const vi_point points[], const int looked_for[],
                           const vi_flight_instant *from, const vi_approach first[], vi_scan_found *found)
{
    scanner s;
    s.scan = scan;
    s.flight = flight;
    s.points = points;
    s.looked_for = looked_for;
    vi_scan_renew(scan, flight->model);
    begin(&s, from, first);
    const int longest = longest_level(scan, flight);
    int l = level_between(&s, -1, longest);
    for (found->blocks = 0; found->blocks < MOST_BLOCKS && l >= 0; ++found->blocks) {
        const vi_scan_level *level = vi_scan_level_of(scan, flight->model, l);
        verdict next;
        int contact = 0;
        const int steps = cleared(&s, level, &next, &contact);
        if (s.at.u + (double)steps * level->step >= flight->length) {
            return VI_SCAN_CLEAR;
        }
        if (next == HAS_CONTACT) {
            bracket(&s, scan, l, steps, contact, found);
            return VI_SCAN_BRACKET;
        }
        if (steps > 0) {
            advance(&s, level, steps);
        }
        l = steps < VI_SCAN_SAMPLES ? level_between(&s, -1, l - 1)
                                    : level_between(&s, l, l + STEEPEST_RISE < longest ? l + STEEPEST_RISE : longest);
    }
    found->low = s.at.u;
    return VI_SCAN_STUCK;
}
