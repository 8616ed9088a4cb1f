#include "modes/coupled_response.h"

#include <math.h>
#include <string.h>

static void fill(vi_coupled_equations *equations, const vi_pressed_body *body, vi_complex s)
{
    const int n = body->modes;
    for (int j = 0; j < n + body->contacts; ++j) {
        memset(equations->factor[j], 0, sizeof equations->factor[j]);
        equations->row[j] = j;
    }
    for (int j = 0; j < n; ++j) {
        vi_complex *row = equations->factor[j];
        for (int i = 0; i < n && body->coupled; ++i) {
            row[i] = vi_complex_scale(body->coupling[j][i], s);
        }
        const double natural = sqrt(fabs(body->square[j]));
        const double detuning = s.re == 0.0 && body->square[j] >= 0.0
                                    ? (natural - s.im) * (natural + s.im)
                                    : body->square[j] + (s.re - s.im) * (s.re + s.im);
        const vi_complex own = {detuning, 2.0 * s.re * s.im};
        const vi_complex drag = vi_complex_scale(body->coupled ? 0.0 : 2.0 * body->decay[j], s);
        row[j] = vi_complex_add(row[j], vi_complex_add(own, drag));
    }
    for (int k = 0; k < body->contacts; ++k) {
        const vi_complex z = {body->stiffness[k] + body->damping[k] * s.re, body->damping[k] * s.im};
        for (int j = 0; j < n; ++j) {
            equations->factor[j][n + k].re = equations->factor[n + k][j].re = body->shape[k][j];
        }
        if (!body->held[k]) {
            equations->factor[n + k][n + k] = vi_complex_scale(-1.0, vi_complex_invert(z));
        }
    }
}

static void bring_pivot(vi_coupled_equations *equations, int step)
{
    int best = step;
    for (int i = step + 1; i < equations->unknowns; ++i) {
        const double size = vi_complex_square(equations->factor[i][step]);
        best = size > vi_complex_square(equations->factor[best][step]) ? i : best;
    }
    if (best != step) {
        const int32_t row = equations->row[step];
        equations->row[step] = equations->row[best];
        equations->row[best] = row;
        for (int j = 0; j < equations->unknowns; ++j) {
            const vi_complex kept = equations->factor[step][j];
            equations->factor[step][j] = equations->factor[best][j];
            equations->factor[best][j] = kept;
        }
    }
}

void vi_coupled_equations_find(vi_coupled_equations *equations, const vi_pressed_body *body, vi_complex s)
{
    equations->known = 1;
    equations->unknowns = body->modes + body->contacts;
    equations->s = s;
    fill(equations, body, s);
    for (int step = 0; step < equations->unknowns; ++step) {
        bring_pivot(equations, step);
        const vi_complex *from = equations->factor[step], pivot = vi_complex_invert(from[step]);
        for (int i = step + 1; i < equations->unknowns; ++i) {
            vi_complex *into = equations->factor[i];
            if (into[step].re == 0.0 && into[step].im == 0.0) {
                continue;
            }
            into[step] = vi_complex_multiply(into[step], pivot);
            for (int j = step + 1; j < equations->unknowns; ++j) {
                into[j] = vi_complex_subtract(into[j], vi_complex_multiply(into[step], from[j]));
            }
        }
    }
}

void vi_coupled_response(const vi_coupled_equations *equations, const vi_pressed_body *body, const vi_complex load[],
                         const vi_complex offset[], vi_complex q[], vi_complex force[])
{
    const int n = body->modes;
    vi_complex x[VI_UNKNOWNS];
    for (int i = 0; i < equations->unknowns; ++i) {
        const int row = equations->row[i];
        x[i] = row < n ? load[row] : offset[row - n];
        for (int j = 0; j < i; ++j) {
            x[i] = vi_complex_subtract(x[i], vi_complex_multiply(equations->factor[i][j], x[j]));
        }
    }
    for (int i = equations->unknowns - 1; i >= 0; --i) {
        for (int j = i + 1; j < equations->unknowns; ++j) {
            x[i] = vi_complex_subtract(x[i], vi_complex_multiply(equations->factor[i][j], x[j]));
        }
        x[i] = vi_complex_divide(x[i], equations->factor[i][i]);
    }
    memcpy(q, x, (size_t)n * sizeof *x);
    memcpy(force, x + n, (size_t)body->contacts * sizeof *x);
}
