#include "modes/pressed_modes.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Most sweeps of the search; five to ten are usual. */
enum { MOST_SWEEPS = 60 };
/* Step, relative to the distance from the pole, below which the search ends: the next step would be its square. */
static const double CLOSE = 1e-9;
/* Distance of rates from each other, from their conjugate or from 0, relative to their size. Closer rates have vectors
 * that cannot be distinguished. */
static const double APART = 1e-6;
/* Growth of a rate, relative to the rate, below which it is rounding and set to 0. */
static const double NO_GROWTH = 1e-13;

/* Least distance of a first guess from a pole, as a share of the way to the next pole. */
static const double NOT_ON_A_POLE = 0.05;

/* An unknown rate: pole + offset. */
typedef struct {
    int base;          /* mode of the pole; -1: none */
    int pair;          /* stands for its conjugate too */
    vi_complex offset;
} zero;

typedef struct {
    const vi_pressed_body *body;
    int count, zeros;
    int mode[VI_MODES]; /* the modes with a part in the point */
    vi_complex pole[VI_MODES];
    zero zero[VI_TERMS];
} search;

static vi_complex pole_of(const vi_pressed_body *body, int j)
{
    const double natural = sqrt(body->square[j]), decay = body->decay[j];
    return (vi_complex){-decay, sqrt((natural - decay) * (natural + decay))};
}

static vi_complex origin_of(const search *s, const zero *z)
{
    return z->base < 0 ? (vi_complex){0.0, 0.0} : s->pole[z->base];
}

static vi_complex rate_of(const search *s, const zero *z)
{
    return vi_complex_add(origin_of(s, z), z->offset);
}

/* 1 / (rate - a), exact where both are close to one pole. */
static vi_complex inverse_distance(const search *s, const zero *z, vi_complex a)
{
    return vi_complex_invert(vi_complex_add(vi_complex_subtract(origin_of(s, z), a), z->offset));
}

/* Sum of n^2 g over the modes, with g = 1 / (s^2 + D s + W), and its derivative. poles: part of the poles in the
 * polynomial's logarithmic derivative. */
static void sum_modes(const search *s, const zero *z, vi_complex *sum, vi_complex *slope, vi_complex *poles)
{
    *sum = *slope = *poles = (vi_complex){0.0, 0.0};
    for (int i = 0; i < s->count; ++i) {
        const int j = s->mode[i];
        const vi_complex a = inverse_distance(s, z, s->pole[j]), b = inverse_distance(s, z, vi_complex_conjugate(s->pole[j]));
        const vi_complex both = vi_complex_add(a, b);
        const double n = s->body->shape[0][j];
        const vi_complex g = vi_complex_scale(n * n, vi_complex_multiply(a, b));
        *sum = vi_complex_add(*sum, g);
        *slope = vi_complex_subtract(*slope, vi_complex_multiply(g, both));
        *poles = vi_complex_add(*poles, both);
    }
}

/* Part of the other zeros in the logarithmic derivative; subtracting it prevents finding a zero twice. */
static vi_complex repulsion(const search *s, int i)
{
    const zero *z = &s->zero[i];
    vi_complex sum = {0.0, 0.0};
    for (int l = 0; l < s->zeros; ++l) {
        const zero *other = &s->zero[l];
        const vi_complex origin = origin_of(s, other);
        if (l != i) {
            const vi_complex apart = vi_complex_subtract(origin_of(s, z), origin);
            const vi_complex within = vi_complex_subtract(z->offset, other->offset);
            sum = vi_complex_add(sum, vi_complex_invert(vi_complex_add(apart, within)));
        }
        if (other->pair) {
            const vi_complex mirrored = vi_complex_add(vi_complex_conjugate(origin), vi_complex_conjugate(other->offset));
            sum = vi_complex_add(sum, inverse_distance(s, z, mirrored));
        }
    }
    return sum;
}

/* Newton step for the polynomial whose zeros are the rates, with the other zeros divided out (Aberth, Ehrlich). */
static vi_complex step_of(const search *s, int i)
{
    const vi_pressed_body *body = s->body;
    const vi_complex rate = rate_of(s, &s->zero[i]);
    vi_complex value, slope, poles;
    sum_modes(s, &s->zero[i], &value, &slope, &poles);
    if (!body->held[0]) { /* value = 1 + Z sum */
        const vi_complex z = {body->stiffness[0] + body->damping[0] * rate.re, body->damping[0] * rate.im};
        slope = vi_complex_add(vi_complex_multiply(z, slope), vi_complex_scale(body->damping[0], value));
        value = vi_complex_multiply(z, value);
        value.re += 1.0;
    }
    if (value.re == 0.0 && value.im == 0.0) {
        return value;
    }
    const vi_complex whole = vi_complex_add(vi_complex_divide(slope, value), poles);
    vi_complex step = vi_complex_invert(vi_complex_subtract(repulsion(s, i), whole));
    step.im = s->zero[i].pair ? step.im : 0.0;
    return step;
}

/* Count a zero from its nearest pole. */
static void rebase(const search *s, zero *z)
{
    const vi_complex origin = origin_of(s, z);
    double nearest = vi_complex_square(z->offset);
    int best = z->base;
    for (int i = 0; i < s->count && z->pair; ++i) {
        const vi_complex way = vi_complex_add(vi_complex_subtract(origin, s->pole[s->mode[i]]), z->offset);
        if (vi_complex_square(way) < nearest) {
            nearest = vi_complex_square(way);
            best = s->mode[i];
        }
    }
    if (best != z->base) {
        z->offset = vi_complex_add(vi_complex_subtract(origin, s->pole[best]), z->offset);
        z->base = best;
    }
}

static bool find_zeros(search *s)
{
    bool close = false;
    for (int sweep = 0; sweep < MOST_SWEEPS; ++sweep) {
        double largest = 0.0;
        for (int i = 0; i < s->zeros; ++i) {
            zero *z = &s->zero[i];
            const vi_complex step = step_of(s, i);
            const vi_complex before = z->offset;
            z->offset = vi_complex_add(before, step);
            if (vi_complex_square(z->offset) == 0.0) { /* next to a pole, but not on it */
                z->offset = vi_complex_scale(DBL_EPSILON, before);
            }
            rebase(s, z);
            const double relative = vi_complex_size(step) / vi_complex_size(z->offset);
            largest = relative > largest || isnan(relative) ? relative : largest;
            if (isnan(largest)) {
                return false;
            }
        }
        if (close) {
            return true;
        }
        close = largest < CLOSE;
    }
    return false;
}

static void guess(search *s, double square, double decay, double to)
{
    const double left = square - decay * decay;
    zero *z = &s->zero[s->zeros++];
    *z = (zero){-1, 1, {-decay, left > 0.0 ? sqrt(left) : to}};
    rebase(s, z);
}

/* Guess the zeros between two poles: where the two alone would have a zero, but not on a pole. */
static void guess_between(search *s)
{
    const vi_pressed_body *body = s->body;
    for (int i = 0; i + 1 < s->count; ++i) {
        const int a = s->mode[i], b = s->mode[i + 1];
        const double na = body->shape[0][a] * body->shape[0][a], nb = body->shape[0][b] * body->shape[0][b];
        const double share = fmin(fmax(na / (na + nb), NOT_ON_A_POLE), 1.0 - NOT_ON_A_POLE);
        guess(s, body->square[a] + share * (body->square[b] - body->square[a]),
              body->decay[a] + share * (body->decay[b] - body->decay[a]), 0.5 * (s->pole[a].im + s->pole[b].im));
    }
}

/* The mode made by the stop, from the body's mobility. */
static void stop_mode(const search *s, double *square, double *decay)
{
    const vi_pressed_body *body = s->body;
    const int last = s->mode[s->count - 1];
    double mobility = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        mobility += body->shape[0][j] * body->shape[0][j];
    }
    *square = body->square[last] + body->stiffness[0] * mobility;
    *decay = body->decay[last] + 0.5 * body->damping[0] * mobility;
}

/* Are the two rates of this mode real, because the dashpot is strong? */
static bool strong_dashpot(const search *s)
{
    double square, decay;
    stop_mode(s, &square, &decay);
    return decay * decay > square;
}

static void guess_stop(search *s, bool real)
{
    double square, decay;
    stop_mode(s, &square, &decay);
    if (!real) {
        guess(s, square, fmin(decay, 0.9 * sqrt(square)), sqrt(square));
        return;
    }
    const double left = decay * decay - square, fast = decay + (left > 0.0 ? sqrt(left) : 0.1 * decay);
    s->zeros += 2;
    s->zero[s->zeros - 2] = (zero){-1, 0, {-square / fast, 0.0}};
    s->zero[s->zeros - 1] = (zero){-1, 0, {-fast, 0.0}};
}

/* ---- terms ---- */

static void add_term(vi_pressed_modes *found, const search *s, const zero *z)
{
    const vi_pressed_body *body = s->body;
    const int m = found->terms++;
    vi_complex *vector = found->vector[m], rate = rate_of(s, z);
    const double size = vi_complex_size(rate);
    rate.re = rate.re > 0.0 && rate.re < NO_GROWTH * size ? 0.0 : rate.re;
    found->rate[m] = rate;
    found->force[m][0] = (vi_complex){-1.0, 0.0};
    memset(vector, 0, sizeof found->vector[m]);
    vi_complex norm = {0.0, 0.0}, touch = {0.0, 0.0};
    for (int i = 0; i < s->count; ++i) {
        const int j = s->mode[i];
        const vi_complex a = inverse_distance(s, z, s->pole[j]), b = inverse_distance(s, z, vi_complex_conjugate(s->pole[j]));
        vector[j] = vi_complex_scale(body->shape[0][j], vi_complex_multiply(a, b));
        const vi_complex slope = {2.0 * (rate.re + body->decay[j]), 2.0 * rate.im};
        norm = vi_complex_add(norm, vi_complex_multiply(slope, vi_complex_multiply(vector[j], vector[j])));
    }
    if (!body->held[0]) { /* n.vector = -1/Z */
        const vi_complex z_now = {body->stiffness[0] + body->damping[0] * rate.re, body->damping[0] * rate.im};
        const vi_complex at = vi_complex_scale(-1.0, vi_complex_invert(z_now));
        touch = vi_complex_scale(body->damping[0], at);
        norm = vi_complex_add(norm, vi_complex_multiply(touch, at));
    }
    for (int j = 0; j < body->modes; ++j) {
        const vi_complex turn = {rate.re + 2.0 * body->decay[j], rate.im};
        found->pull[m][j] = vi_complex_add(vi_complex_multiply(turn, vector[j]),
                                           vi_complex_scale(body->shape[0][j], touch));
    }
    found->share[m] = vi_complex_scale(z->pair ? 2.0 : 1.0, vi_complex_invert(norm));
}

/* Add a mode with no part in the point: it stays as it is. */
static void add_free(vi_pressed_modes *found, const vi_pressed_body *body, int j)
{
    const int m = found->terms++;
    found->rate[m] = pole_of(body, j);
    memset(found->vector[m], 0, sizeof found->vector[m]);
    found->vector[m][j] = (vi_complex){1.0, 0.0};
    found->force[m][0] = (vi_complex){0.0, 0.0};
    memset(found->pull[m], 0, sizeof found->pull[m]);
    found->pull[m][j] = (vi_complex){-found->rate[m].re, found->rate[m].im}; /* rate + 2 decay */
    found->share[m] = (vi_complex){0.0, -1.0 / found->rate[m].im};
}

/* ---- checks ---- */

/* Is each rate distinct from all others, decaying, and on its side of the real axis? */
static bool apart(const vi_pressed_modes *found)
{
    for (int m = 0; m < found->terms; ++m) {
        const vi_complex rate = found->rate[m];
        const double size = vi_complex_size(rate);
        const bool pair = rate.im != 0.0;
        if (!(size > 0.0) || !isfinite(size) || !(rate.re <= 0.0) || (pair && !(rate.im > APART * size))) {
            return false;
        }
        for (int l = 0; l < m; ++l) {
            if (!(vi_complex_size(vi_complex_subtract(rate, found->rate[l])) > APART * size)) {
                return false;
            }
        }
    }
    return true;
}

/* One mode against a stop: solve a quadratic. */
static bool find_single(vi_pressed_modes *found, const vi_pressed_body *body)
{
    const double n = body->shape[0][0];
    const double decay = body->decay[0] + 0.5 * body->damping[0] * n * n;
    const double square = body->square[0] + body->stiffness[0] * n * n;
    const double root = sqrt(square), left = (root - decay) * (root + decay), rest = sqrt(fabs(left));
    const int pair = left > 0.0;
    const vi_complex rates[2] = {{pair ? -decay : -square / (decay + rest), pair ? rest : 0.0}, {-(decay + rest), 0.0}};
    found->terms = pair ? 1 : 2;
    for (int m = 0; m < found->terms; ++m) {
        found->rate[m] = rates[m];
        found->vector[m][0] = (vi_complex){1.0, 0.0};
        const vi_complex z = {body->stiffness[0] + body->damping[0] * rates[m].re, body->damping[0] * rates[m].im};
        /* for a vector of 1 the force is Z n: scale it to -1, as for all vectors */
        const vi_complex scale = vi_complex_scale(-1.0, vi_complex_invert(vi_complex_scale(n, z)));
        found->vector[m][0] = scale;
        found->force[m][0] = (vi_complex){-1.0, 0.0};
        const vi_complex turn = {rates[m].re + 2.0 * decay, rates[m].im};
        found->pull[m][0] = vi_complex_multiply(turn, scale);
        const vi_complex slope = {2.0 * (rates[m].re + decay), 2.0 * rates[m].im};
        const vi_complex norm = vi_complex_multiply(slope, vi_complex_multiply(scale, scale));
        found->share[m] = vi_complex_scale(pair ? 2.0 : 1.0, vi_complex_invert(norm));
    }
    return true;
}

static bool find_coupled(vi_pressed_modes *found, search *s, bool real)
{
    s->zeros = 0;
    guess_between(s);
    if (!s->body->held[0]) {
        guess_stop(s, real);
    }
    if (!find_zeros(s)) {
        return false;
    }
    found->terms = 0;
    for (int i = 0; i < s->zeros; ++i) {
        add_term(found, s, &s->zero[i]);
    }
    for (int j = 0; j < s->body->modes; ++j) {
        if (s->body->shape[0][j] == 0.0) {
            add_free(found, s->body, j);
        }
    }
    vi_pressed_terms_sort(found);
    return apart(found) && vi_pressed_terms_are_complete(found, s->body);
}

bool vi_pressed_modes_find(vi_pressed_modes *found, const vi_pressed_body *body)
{
    search s = {.body = body};
    found->modes = body->modes;
    for (int j = 0; j < body->modes; ++j) {
        if (body->shape[0][j] != 0.0) {
            s.mode[s.count++] = j;
        }
        s.pole[j] = pole_of(body, j);
    }
    if (s.count == 0) {
        return false;
    }
    if (body->modes == 1) {
        return !body->held[0] && find_single(found, body) && apart(found) && vi_pressed_terms_are_complete(found, body);
    }
    for (int j = 0; j < body->modes; ++j) {
        if (!(s.pole[j].im >= APART * sqrt(body->square[j])) || (body->shape[0][j] == 0.0 && !(s.pole[j].im > 0.0))) {
            return false;
        }
    }
    const bool real = !body->held[0] && strong_dashpot(&s);
    return find_coupled(found, &s, real) || (!body->held[0] && find_coupled(found, &s, !real));
}
