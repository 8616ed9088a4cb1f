#include "modes/coupled_modes.h"

#include <math.h>
#include <string.h>

#include "modes/reflection.h"
#include "motion/majorant.h"

/* Part of a held contact's shape left by the others, relative to the shape, above which it is independent. */
static const double INDEPENDENT = 1e-6;
/* Imaginary part of a rate, relative to the rate, up to which the rate is real. Above REAL and below CRITICAL the rate
 * is nearly critical, and the modes are not used. */
static const double REAL = 1e-12, CRITICAL = 1e-6;
/* Growth of a rate, relative to the rate, below which it is rounding and set to 0. */
static const double NO_GROWTH = 1e-13;

/* ---- held contacts ---- */

/* Add the reflection that frees motions with this contact in place of their next first component. False where the
 * contact nearly depends on the earlier ones. */
static bool add_reflection(int n, const double shape[], vi_coupled_work *work)
{
    const int i = work->reflections;
    double *v = work->reflection[i];
    memcpy(v, shape, (size_t)n * sizeof *v);
    for (int l = 0; l < i; ++l) {
        vi_reflect(n, work->reflection[l], v);
        work->triangle[l][i] = v[l];
        v[l] = 0.0; /* later reflections leave v unchanged */
    }
    const double length = sqrt(vi_dot(n, v, v));
    if (!(length > INDEPENDENT * sqrt(vi_dot(n, shape, shape)))) {
        return false;
    }
    work->triangle[i][i] = v[i] > 0.0 ? -length : length;
    v[i] -= work->triangle[i][i];
    const double size = sqrt(vi_dot(n, v, v));
    for (int j = 0; j < n; ++j) {
        v[j] /= size;
    }
    work->reflections = i + 1;
    return true;
}

static bool reflect_held(const vi_pressed_body *body, vi_coupled_work *work)
{
    work->reflections = 0;
    for (int k = 0; k < body->contacts; ++k) {
        if (body->held[k] && (work->reflections >= body->modes - 1 || !add_reflection(body->modes, body->shape[k], work))) {
            return false;
        }
    }
    return true;
}

static void reflect_in(const vi_pressed_body *body, const vi_coupled_work *work, double x[])
{
    for (int i = 0; i < work->reflections; ++i) {
        vi_reflect(body->modes, work->reflection[i], x);
    }
}

static void reflect_out(const vi_pressed_body *body, const vi_coupled_work *work, double x[])
{
    for (int i = work->reflections - 1; i >= 0; --i) {
        vi_reflect(body->modes, work->reflection[i], x);
    }
}

/* Forces of the held contacts that balance `load`. */
static void holding(const vi_pressed_body *body, const vi_coupled_work *work, double load[], double force[])
{
    reflect_in(body, work, load);
    for (int i = work->reflections - 1; i >= 0; --i) {
        force[i] = load[i];
        for (int l = i + 1; l < work->reflections; ++l) {
            force[i] -= work->triangle[i][l] * force[l];
        }
        force[i] /= work->triangle[i][i];
    }
}

/* ---- modes without damping ---- */

static void add_row(const vi_pressed_body *body, vi_coupled_work *work, double x[], int row)
{
    reflect_in(body, work, x);
    memcpy(work->factor[row], x + work->reflections, (size_t)(body->modes - work->reflections) * sizeof *x);
}

static bool find_real_modes(const vi_pressed_body *body, vi_coupled_work *work)
{
    const int n = body->modes, left = n - work->reflections;
    int rows = n;
    for (int j = 0; j < n; ++j) {
        double x[VI_MODES] = {0.0};
        x[j] = sqrt(body->square[j]);
        add_row(body, work, x, j);
    }
    for (int k = 0; k < body->contacts; ++k) {
        double x[VI_MODES];
        for (int j = 0; j < n; ++j) {
            x[j] = sqrt(body->stiffness[k]) * body->shape[k][j];
        }
        if (!body->held[k]) {
            add_row(body, work, x, rows++);
        }
    }
    if (!vi_singular_find(rows, left, work->factor, &work->real) || work->real.rank != left) {
        return false;
    }
    for (int i = 0; i < left; ++i) {
        double *shape = work->shape[i];
        memset(shape, 0, sizeof work->shape[i]);
        memcpy(shape + work->reflections, work->real.right[i], (size_t)left * sizeof *shape);
        reflect_out(body, work, shape);
    }
    return true;
}

/* Displacements of the pressing contacts; small ones of slow modes keep their digits. */
static void look_at_contacts(const vi_pressed_body *body, vi_coupled_work *work)
{
    int row = body->modes;
    for (int k = 0; k < body->contacts; ++k) {
        for (int i = 0; i < work->real.rank; ++i) {
            work->at[k][i] = body->held[k] ? 0.0
                                           : work->real.value[i] * work->real.left[i][row] / sqrt(body->stiffness[k]);
        }
        row += !body->held[k];
    }
}

static void couple(const vi_pressed_body *body, vi_coupled_work *work)
{
    for (int i = 0; i < work->real.rank; ++i) {
        double drag[VI_MODES] = {0.0};
        for (int j = 0; j < body->modes; ++j) {
            drag[j] = vi_pressed_drag(body, j, work->shape[i]);
        }
        for (int l = 0; l <= i; ++l) {
            double sum = vi_dot(body->modes, drag, work->shape[l]);
            for (int k = 0; k < body->contacts; ++k) {
                sum += body->held[k] ? 0.0 : body->damping[k] * work->at[k][i] * work->at[k][l];
            }
            work->damping[i][l] = work->damping[l][i] = sum;
        }
    }
}

/* ---- damped modes ---- */

/* Place of a mode in the states, fast modes first: the rounding of a rotation is then small beside its result. */
static int state_of(const vi_coupled_work *work, int i)
{
    return 2 * (work->real.rank - 1 - i);
}

static void fill_matrix(vi_coupled_work *work)
{
    const int modes = work->real.rank;
    for (int k = 0; k < 2 * modes; ++k) {
        memset(work->matrix[k], 0, sizeof work->matrix[k]);
    }
    for (int i = 0; i < modes; ++i) {
        const int at = state_of(work, i);
        work->matrix[at][at + 1].im = work->matrix[at + 1][at].im = work->real.value[i];
        for (int l = 0; l < modes; ++l) {
            work->matrix[at + 1][state_of(work, l) + 1].re = -work->damping[i][l];
        }
    }
}

/* Rate of a vector by Rayleigh's quotient; its error is the square of the vector's error. */
static vi_complex rate_of(const vi_coupled_work *work, const vi_complex vector[])
{
    vi_complex sum = {0.0, 0.0};
    for (int i = 0; i < work->real.rank; ++i) {
        const int at = state_of(work, i);
        const vi_complex stiff = vi_complex_scale(2.0 * work->real.value[i], vector[at]);
        vi_complex drag = {-stiff.im, stiff.re};
        for (int l = 0; l < work->real.rank; ++l) {
            drag = vi_complex_subtract(drag, vi_complex_scale(work->damping[i][l], vector[state_of(work, l) + 1]));
        }
        sum = vi_complex_add(sum, vi_complex_multiply(drag, vector[at + 1]));
    }
    return sum;
}

/* Displacement of a contact when the undamped modes move by x. */
static vi_complex weighed(int modes, const double weight[], const vi_complex x[])
{
    vi_complex sum = {0.0, 0.0};
    for (int i = 0; i < modes; ++i) {
        sum.re += weight[i] * x[i].re;
        sum.im += weight[i] * x[i].im;
    }
    return sum;
}

/* Add the forces of the held contacts, which balance the other contacts and the body itself. */
static void add_holding(vi_pressed_modes *found, const vi_pressed_body *body, const vi_coupled_work *work, int m)
{
    const vi_complex rate = found->rate[m], *vector = found->vector[m];
    double re[VI_MODES], im[VI_MODES], load[VI_MODES], across[VI_MODES], force[VI_PORTS], turned[VI_PORTS];
    for (int j = 0; j < body->modes; ++j) {
        re[j] = vector[j].re;
        im[j] = vector[j].im;
    }
    for (int j = 0; j < body->modes; ++j) {
        const vi_complex drag = {vi_pressed_drag(body, j, re), vi_pressed_drag(body, j, im)};
        vi_complex sum = vi_complex_multiply(rate, vi_complex_add(drag, vi_complex_multiply(rate, vector[j])));
        sum = vi_complex_add(sum, vi_complex_scale(body->square[j], vector[j]));
        for (int k = 0; k < body->contacts; ++k) {
            sum = vi_complex_add(sum, vi_complex_scale(body->held[k] ? 0.0 : body->shape[k][j], found->force[m][k]));
        }
        load[j] = -sum.re;
        across[j] = -sum.im;
    }
    holding(body, work, load, force);
    holding(body, work, across, turned);
    for (int k = 0, i = 0; k < body->contacts; ++k) {
        if (body->held[k]) {
            found->force[m][k] = (vi_complex){force[i], turned[i]};
            ++i;
        }
    }
}

/* Combine undamped modes that move by x to a displacement in all modes. */
static void combine(const vi_pressed_body *body, const vi_coupled_work *work, const vi_complex x[], vi_complex sum[])
{
    memset(sum, 0, (size_t)body->modes * sizeof *sum);
    for (int i = 0; i < work->real.rank; ++i) {
        for (int j = 0; j < body->modes; ++j) {
            sum[j].re += work->shape[i][j] * x[i].re;
            sum[j].im += work->shape[i][j] * x[i].im;
        }
    }
}

/* Displacement of an undamped mode whose state is (natural x, -i rate x), from the larger one, for its digits. */
static vi_complex displacement(const vi_complex state[2], double natural, vi_complex rate)
{
    if (natural >= vi_complex_size(rate)) {
        return vi_complex_scale(1.0 / natural, state[0]);
    }
    return vi_complex_divide((vi_complex){-state[1].im, state[1].re}, rate);
}

static void add_term(vi_pressed_modes *found, const vi_pressed_body *body, const vi_coupled_work *work, vi_complex rate,
                     const vi_complex state[])
{
    const int m = found->terms++, modes = work->real.rank;
    vi_complex x[VI_MODES], pull[VI_MODES];
    found->rate[m] = rate;
    found->share[m] = vi_complex_scale(rate.im > 0.0 ? -2.0 : -1.0, rate);
    for (int i = 0; i < modes; ++i) {
        const double natural = work->real.value[i];
        x[i] = displacement(&state[state_of(work, i)], natural, rate);
        /* (rate + damping) vector = -stiffness vector / rate: no difference of large numbers */
        pull[i] = vi_complex_scale(-natural * natural, vi_complex_divide(x[i], rate));
    }
    combine(body, work, x, found->vector[m]);
    combine(body, work, pull, found->pull[m]);
    for (int k = 0; k < body->contacts; ++k) {
        const vi_complex z = {body->stiffness[k] + body->damping[k] * rate.re, body->damping[k] * rate.im};
        found->force[m][k] = vi_complex_multiply(z, weighed(modes, work->at[k], x)); /* 0 for a held contact, for now */
    }
    if (work->reflections > 0) {
        add_holding(found, body, work, m);
    }
}

/* Index of the slowest rate left, the first of a conjugate pair; -1: none. */
static int slowest(int states, const vi_complex rate[], const bool taken[])
{
    int best = -1;
    for (int k = 0; k < states; ++k) {
        if (!taken[k] && (best < 0 || vi_complex_square(rate[k]) < vi_complex_square(rate[best]))) {
            best = k;
        }
    }
    return best;
}

/* Add terms in the order of their rates; false where rates are nearly critical, or half of a pair is missing. */
static bool add_terms(vi_pressed_modes *found, const vi_pressed_body *body, const vi_coupled_work *work)
{
    const int states = 2 * work->real.rank;
    vi_complex rate[VI_STATES];
    bool taken[VI_STATES] = {false};
    int covered = 0;
    for (int k = 0; k < states; ++k) {
        rate[k] = rate_of(work, work->vector[k]);
        const double size = vi_complex_size(rate[k]);
        rate[k].im = fabs(rate[k].im) <= REAL * size ? 0.0 : rate[k].im;
        rate[k].re = rate[k].re > 0.0 && rate[k].re < NO_GROWTH * size ? 0.0 : rate[k].re;
        if (!(size > 0.0) || !isfinite(size) || rate[k].re > 0.0
            || (rate[k].im != 0.0 && fabs(rate[k].im) < CRITICAL * size)) {
            return false;
        }
        taken[k] = rate[k].im < 0.0;
        covered += rate[k].im > 0.0 ? 2 : rate[k].im == 0.0 ? 1 : 0;
    }
    for (int k = slowest(states, rate, taken); k >= 0; k = slowest(states, rate, taken)) {
        taken[k] = true;
        add_term(found, body, work, rate[k], work->vector[k]);
    }
    return covered == states;
}

bool vi_coupled_modes_find(vi_pressed_modes *found, const vi_pressed_body *body, vi_coupled_work *work)
{
    found->modes = body->modes;
    found->terms = 0;
    if (!reflect_held(body, work) || !find_real_modes(body, work)) {
        return false;
    }
    look_at_contacts(body, work);
    couple(body, work);
    fill_matrix(work);
    return vi_symmetric_find(2 * work->real.rank, work->matrix, work->vector) && add_terms(found, body, work)
           && vi_pressed_terms_are_complete(found, body);
}

double vi_coupled_modes_size(const vi_pressed_modes *modes, const vi_pressed_body *body)
{
    double largest = 0.0;
    for (int m = 0; m < modes->terms; ++m) {
        double square = 0.0;
        for (int j = 0; j < body->modes; ++j) {
            const double rates = body->square[j] + vi_complex_square(modes->rate[m]);
            square += rates * vi_complex_square(modes->vector[m][j]);
        }
        largest = vi_max(largest, square);
    }
    return largest;
}
