#include "modes/pressed_terms.h"

#include <math.h>
#include <string.h>

/* Largest error of a motion split into terms and summed again, relative to the terms. LARGEST_TERMS: largest terms,
 * relative to the motion; next to critical damping they cancel. */
static const double RECOVERED = 1e-13, LARGEST_TERMS = 1e3;

/* ---- order ---- */

static void exchange(vi_pressed_modes *found, int a, int b)
{
    vi_complex vector[VI_MODES], force[VI_PORTS];
    const vi_complex rate = found->rate[a], share = found->share[a];
    memcpy(vector, found->vector[a], sizeof vector);
    memcpy(found->vector[a], found->vector[b], sizeof vector);
    memcpy(found->vector[b], vector, sizeof vector);
    memcpy(vector, found->pull[a], sizeof vector);
    memcpy(found->pull[a], found->pull[b], sizeof vector);
    memcpy(found->pull[b], vector, sizeof vector);
    memcpy(force, found->force[a], sizeof force);
    memcpy(found->force[a], found->force[b], sizeof force);
    memcpy(found->force[b], force, sizeof force);
    found->rate[a] = found->rate[b];
    found->share[a] = found->share[b];
    found->rate[b] = rate;
    found->share[b] = share;
}

/* Sort the terms, slow ones first; they are nearly in order. */
void vi_pressed_terms_sort(vi_pressed_modes *found)
{
    for (int m = 1; m < found->terms; ++m) {
        for (int l = m; l > 0 && vi_complex_square(found->rate[l]) < vi_complex_square(found->rate[l - 1]); --l) {
            exchange(found, l, l - 1);
        }
    }
}

/* ---- a check ---- */

/* Is a motion with this start recovered from its terms, which are not much larger than the motion? */
static bool recovers(const vi_pressed_modes *found, const vi_pressed_body *body, const double q[], const double p[])
{
    vi_complex part[VI_TERMS];
    double displacement[VI_MODES], velocity[VI_MODES], error = 0.0, wrong = 0.0, terms = 0.0, rates = 0.0, whole = 0.0;
    vi_pressed_parts(found, q, p, part);
    vi_pressed_sum(found, part, displacement, velocity);
    for (int m = 0; m < found->terms; ++m) {
        for (int j = 0; j < body->modes; ++j) {
            const double size = vi_complex_size(part[m]) * vi_complex_size(found->vector[m][j]);
            terms += size;
            rates += size * vi_complex_size(found->rate[m]);
        }
    }
    for (int j = 0; j < body->modes; ++j) {
        whole += fabs(q[j]) + fabs(p[j]) / vi_complex_size(found->rate[0]);
        error += fabs(displacement[j] - q[j]);
        wrong += fabs(velocity[j] - p[j]);
    }
    return error <= RECOVERED * terms && wrong <= RECOVERED * rates && terms <= LARGEST_TERMS * whole;
}

/* Subtract from x its part along y. */
static void take_off(int n, const double y[], double x[])
{
    double along = 0.0, square = 0.0;
    for (int j = 0; j < n; ++j) {
        along += x[j] * y[j];
        square += y[j] * y[j];
    }
    for (int j = 0; j < n; ++j) {
        x[j] -= along / square * y[j];
    }
}

/* Subtract from x the parts that move the held contacts. */
static void keep_held(const vi_pressed_body *body, double x[])
{
    double unit[VI_PORTS][VI_MODES];
    int count = 0;
    for (int k = 0; k < body->contacts; ++k) {
        if (body->held[k]) {
            memcpy(unit[count], body->shape[k], sizeof unit[count]);
            for (int i = 0; i < count; ++i) {
                take_off(body->modes, unit[i], unit[count]);
            }
            ++count;
        }
    }
    for (int i = count - 1; i >= 0; --i) {
        take_off(body->modes, unit[i], x);
    }
}

bool vi_pressed_terms_are_complete(const vi_pressed_modes *found, const vi_pressed_body *body)
{
    double x[VI_MODES], none[VI_MODES] = {0.0};
    for (int j = 0; j < body->modes; ++j) {
        x[j] = j % 2 == 0 ? 1.0 : 0.5 + 1.0 / (double)(j + 1);
    }
    keep_held(body, x);
    return recovers(found, body, x, none) && recovers(found, body, none, x);
}

/* ---- use ---- */

double vi_pressed_drag(const vi_pressed_body *body, int j, const double x[])
{
    double sum = 0.0;
    if (!body->coupled) {
        return 2.0 * body->decay[j] * x[j];
    }
    for (int i = 0; i < body->modes; ++i) {
        sum += body->coupling[j][i] * x[i];
    }
    return sum;
}

void vi_pressed_parts(const vi_pressed_modes *modes, const double q[], const double p[], vi_complex part[])
{
    for (int m = 0; m < modes->terms; ++m) {
        const vi_complex *vector = modes->vector[m], *pull = modes->pull[m];
        vi_complex sum = {0.0, 0.0};
        for (int j = 0; j < modes->modes; ++j) {
            sum.re += pull[j].re * q[j] + vector[j].re * p[j];
            sum.im += pull[j].im * q[j] + vector[j].im * p[j];
        }
        part[m] = vi_complex_multiply(modes->share[m], sum);
    }
}

void vi_pressed_sum(const vi_pressed_modes *modes, const vi_complex part[], double q[], double p[])
{
    for (int j = 0; j < modes->modes; ++j) {
        q[j] = p[j] = 0.0;
    }
    for (int m = 0; m < modes->terms; ++m) {
        const vi_complex x = part[m], v = vi_complex_multiply(modes->rate[m], x), *vector = modes->vector[m];
        for (int j = 0; j < modes->modes; ++j) {
            q[j] += x.re * vector[j].re - x.im * vector[j].im;
            p[j] += v.re * vector[j].re - v.im * vector[j].im;
        }
    }
}
