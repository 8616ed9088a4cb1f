#include "door/orbit_coupling.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "modes/coupled_response.h"

/* Largest |z|^2 of a vector with z.z = 1 of the symmetric matrix for which terms are used (equations.md 4.7). Above,
 * terms cancel, and a series takes their place. Bodies of many modes keep their terms, since series take long. */
static const double LARGEST_VECTOR = 10.0;
enum { MANY_MODES = 16, SERIES_TERMS = 18 };
/* Error of a state that recurs, over its size, above which a body that grows loses it. */
static const double RECURRED = 1e-11;
/* Step of the series times the fastest rate: the first term left out is .5^18 / 18!, far below rounding. */
static const double SHORT = 0.5;

VI_DOOR size_t vi_door_orbit_coupling_size(void)
{
    return sizeof(vi_orbit_coupling);
}

VI_DOOR size_t vi_door_orbit_coupling_work_size(void)
{
    return sizeof(vi_coupled_work);
}

static bool fill_body(int modes, const double natural[], const double coupling[], vi_pressed_body *body)
{
    memset(body, 0, sizeof *body);
    body->modes = modes;
    body->coupled = 1;
    bool good = true;
    for (int j = 0; j < modes; ++j) {
        body->square[j] = natural[j] * fabs(natural[j]);
        good = good && natural[j] != 0.0 && isfinite(body->square[j]);
        for (int i = 0; i < modes; ++i) {
            body->coupling[j][i] = 0.5 * (coupling[j * modes + i] + coupling[i * modes + j]);
            good = good && isfinite(body->coupling[j][i]);
        }
    }
    return good;
}

/* Is a mode's stiffness negative? Series follow such a body: its terms need the root of each stiffness. */
static bool has_negative_spring(const vi_pressed_body *body)
{
    bool found = false;
    for (int j = 0; j < body->modes; ++j) {
        found = found || body->square[j] < 0.0;
    }
    return found;
}

static double fastest_rate(const vi_pressed_body *body)
{
    double natural = 0.0, drag = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        double row = 0.0;
        for (int i = 0; i < body->modes; ++i) {
            row += fabs(body->coupling[j][i]);
        }
        natural = fmax(natural, sqrt(fabs(body->square[j])));
        drag = fmax(drag, row);
    }
    return natural + drag;
}

VI_DOOR int vi_door_orbit_couple(int modes, int harmonics, const double angular_frequency[], const double natural[],
                                 const double coupling[], const double cosine[], const double sine[],
                                 vi_orbit_coupling *found, vi_coupled_work *work)
{
    if (modes < 1 || modes > VI_MODES || harmonics < 1 || harmonics > VI_ORBIT_HARMONICS
        || !fill_body(modes, natural, coupling, &found->body)) {
        return 1;
    }
    if (has_negative_spring(&found->body) || !vi_coupled_modes_find(&found->terms, &found->body, work)
        || (modes <= MANY_MODES && vi_coupled_modes_size(&found->terms, &found->body) > LARGEST_VECTOR)) {
        found->terms.terms = 0;
    }
    found->fastest = fastest_rate(&found->body);
    for (int k = 0; k < harmonics; ++k) {
        vi_coupled_equations equations;
        vi_complex load[VI_MODES], none[VI_PORTS] = {{0.0, 0.0}}, force[VI_PORTS];
        vi_coupled_equations_find(&equations, &found->body, (vi_complex){0.0, angular_frequency[k]});
        for (int j = 0; j < modes; ++j) {
            load[j] = (vi_complex){cosine[k * modes + j], -sine[k * modes + j]};
        }
        vi_coupled_response(&equations, &found->body, load, none, found->steady[k], force);
    }
    return 0;
}

/* ---- by series ---- */

static void series_step(const vi_orbit_coupling *coupling, double h, double x[], double v[])
{
    const vi_pressed_body *body = &coupling->body;
    double dx[VI_MODES], dv[VI_MODES], faster[VI_MODES];
    memcpy(dx, x, (size_t)body->modes * sizeof *dx);
    memcpy(dv, v, (size_t)body->modes * sizeof *dv);
    for (int n = 1; n <= SERIES_TERMS; ++n) {
        for (int j = 0; j < body->modes; ++j) {
            faster[j] = -body->square[j] * dx[j] - vi_pressed_drag(body, j, dv);
        }
        for (int j = 0; j < body->modes; ++j) {
            dx[j] = dv[j] * h / n;
            dv[j] = faster[j] * h / n;
            x[j] += dx[j];
            v[j] += dv[j];
        }
    }
}

void vi_orbit_series(const vi_orbit_coupling *coupling, double u, double x[], double v[])
{
    const double steps = ceil(coupling->fastest * u / SHORT);
    for (double step = 0.0; step < steps; step += 1.0) {
        series_step(coupling, u / steps, x, v);
    }
}

/* Solve a x = b for `sides` right-hand sides, b[side][n], by elimination with pivots; false where a is singular. */
static bool solve(int n, double a[][VI_STATES], int sides, double b[][VI_STATES], double singular)
{
    for (int k = 0; k < n; ++k) {
        int pivot = k;
        for (int i = k + 1; i < n; ++i) {
            pivot = fabs(a[i][k]) > fabs(a[pivot][k]) ? i : pivot;
        }
        if (!(fabs(a[pivot][k]) > singular)) {
            return false;
        }
        for (int j = 0; pivot != k && j < n + sides; ++j) {
            double *one = j < n ? &a[k][j] : &b[j - n][k], *other = j < n ? &a[pivot][j] : &b[j - n][pivot];
            const double kept = *one;
            *one = *other;
            *other = kept;
        }
        for (int i = k + 1; i < n; ++i) {
            const double share = a[i][k] / a[k][k];
            for (int j = k; j < n; ++j) {
                a[i][j] -= share * a[k][j];
            }
            for (int side = 0; side < sides; ++side) {
                b[side][i] -= share * b[side][k];
            }
        }
    }
    for (int side = 0; side < sides; ++side) {
        for (int k = n - 1; k >= 0; --k) {
            for (int i = k + 1; i < n; ++i) {
                b[side][k] -= a[k][i] * b[side][i];
            }
            b[side][k] /= a[k][k];
        }
    }
    return true;
}

/* Does a state come back after `length` seconds and an impulse? A body that grows multiplies rounding until then. */
static bool recurs(const vi_orbit_coupling *coupling, const double impulse[], double length, const double state[])
{
    const int modes = coupling->body.modes;
    double later[VI_STATES], off = 0.0, size = 0.0;
    memcpy(later, state, 2 * (size_t)modes * sizeof *later);
    vi_orbit_series(coupling, length, later, later + modes);
    for (int j = 0; j < modes; ++j) {
        const double natural = sqrt(fabs(coupling->body.square[j]));
        off = fmax(off, fmax(natural * fabs(later[j] - state[j]), fabs(later[modes + j] + impulse[j] - state[modes + j])));
        size = fmax(size, fmax(natural * fabs(state[j]), fabs(state[modes + j])));
    }
    return off <= RECURRED * size;
}

bool vi_orbit_recurring_states(const vi_orbit_coupling *coupling, int contacts, const double impulse[], int stride,
                               double length, double state[][VI_STATES])
{
    const int modes = coupling->body.modes;
    double left[VI_STATES][VI_STATES]; /* 1 - Phi(length), in (w x, v) */
    for (int c = 0; c < 2 * modes; ++c) {
        double moved[VI_STATES] = {0.0};
        moved[c] = c < modes ? 1.0 / sqrt(fabs(coupling->body.square[c])) : 1.0;
        vi_orbit_series(coupling, length, moved, moved + modes);
        for (int j = 0; j < modes; ++j) {
            left[j][c] = (j == c ? 1.0 : 0.0) - sqrt(fabs(coupling->body.square[j])) * moved[j];
            left[modes + j][c] = (modes + j == c ? 1.0 : 0.0) - moved[modes + j];
        }
    }
    for (int k = 0; k < contacts; ++k) {
        memset(state[k], 0, sizeof state[k]);
        memcpy(state[k] + modes, impulse + (ptrdiff_t)k * stride, (size_t)modes * sizeof state[k][0]);
    }
    if (!solve(2 * modes, left, contacts, state, 4.0 * DBL_EPSILON * (1.0 + coupling->fastest * length))) {
        return false;
    }
    bool good = true;
    for (int k = 0; k < contacts; ++k) {
        for (int j = 0; j < modes; ++j) {
            state[k][j] /= sqrt(fabs(coupling->body.square[j]));
        }
        good = good && recurs(coupling, impulse + (ptrdiff_t)k * stride, length, state[k]);
    }
    return good;
}

/* ---- by terms ---- */

void vi_orbit_turns(const vi_orbit_coupling *coupling, double u, vi_complex turn[])
{
    for (int m = 0; m < coupling->terms.terms; ++m) {
        const vi_complex rate = coupling->terms.rate[m];
        const double left = exp(rate.re * u);
        turn[m] = (vi_complex){left * cos(rate.im * u), left * sin(rate.im * u)};
    }
}

bool vi_orbit_recurring_parts(const vi_orbit_coupling *coupling, const double impulse[], double length,
                              vi_complex part[])
{
    const double rest[VI_MODES] = {0.0};
    vi_pressed_parts(&coupling->terms, rest, impulse, part);
    for (int m = 0; m < coupling->terms.terms; ++m) {
        const vi_complex rate = coupling->terms.rate[m];
        const double angle = rate.im * length, half = sin(0.5 * angle), gone = -expm1(rate.re * length);
        /* 1 - e^(rate length), free of cancellation at light damping */
        const vi_complex whole = {gone * cos(angle) + 2.0 * half * half, (gone - 1.0) * sin(angle)};
        /* an undamped term after whole turns: only rounding is left */
        if (!(vi_complex_size(whole) > 4.0 * DBL_EPSILON * (1.0 + vi_complex_size(rate) * length))) {
            return false;
        }
        part[m] = vi_complex_divide(part[m], whole);
    }
    return true;
}

void vi_orbit_turned_sum(const vi_orbit_coupling *coupling, const vi_complex part[], const vi_complex turn[],
                         double x[], double v[])
{
    vi_complex turned[VI_TERMS];
    for (int m = 0; m < coupling->terms.terms; ++m) {
        turned[m] = vi_complex_multiply(part[m], turn[m]);
    }
    vi_pressed_sum(&coupling->terms, turned, x, v);
}
