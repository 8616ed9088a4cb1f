#include "lanes/many_coupling.h"

#include <math.h>
#include <string.h>

#include "modes/coupled_modes.h"

/* Largest size of a complex mode (see vi_coupled_modes_size); modes of larger size cancel each other's digits. */
static const double LARGEST_SIZE = 10.0;

struct vi_lane_coupling {
    int own, coupled, mode[VI_LANES_MODES]; /* modes that no damping couples, by number, then the others */
    bool across[VI_TERMS]; /* the term of a real rate has an imaginary vector: its real mode is the part's imaginary part */
    vi_pressed_body body, found; /* of the others; the body whose terms are known */
    bool is_known, has_terms;    /* whether `found` is set; whether it has terms that lanes take */
    vi_pressed_modes terms;
    vi_coupled_work work;
};

size_t vi_lane_coupling_size(void)
{
    return sizeof(struct vi_lane_coupling);
}

/* Order the modes: first those that no damping couples. */
static void order_modes(struct vi_lane_coupling *c, int modes, const vi_lanes_points *points, int64_t point)
{
    c->own = c->coupled = 0;
    for (int apart = 1; apart >= 0; --apart) {
        for (int i = 0; i < modes; ++i) {
            bool couples = false;
            for (int j = 0; j < modes; ++j) {
                couples = couples || (i != j && points->coupling[(i * modes + j) * points->count + point] != 0.0);
            }
            if (couples != (apart == 1)) {
                c->mode[c->own + c->coupled] = i;
                c->own += apart;
                c->coupled += 1 - apart;
            }
        }
    }
}

/* Set the body of the coupled modes; false for invalid numbers. */
static bool fill_body(struct vi_lane_coupling *c, int modes, const vi_lanes_points *points, int64_t point)
{
    const int *mode = c->mode + c->own;
    bool good = true;
    memset(&c->body, 0, sizeof c->body);
    c->body.modes = c->coupled;
    c->body.coupled = 1;
    for (int i = 0; i < c->coupled; ++i) {
        c->body.square[i] = points->stiffness[mode[i] * points->count + point];
        good = good && c->body.square[i] > 0.0;
        for (int j = 0; j < c->coupled; ++j) {
            const double damping = points->coupling[(mode[i] * modes + mode[j]) * points->count + point];
            const double back = points->coupling[(mode[j] * modes + mode[i]) * points->count + point];
            c->body.coupling[i][j] = 0.5 * (damping + back);
            good = good && isfinite(c->body.coupling[i][j]);
        }
    }
    return good;
}

/* Find the terms of the coupled modes; false where lanes cannot take them. */
static bool find_terms(struct vi_lane_coupling *c)
{
    if (!vi_coupled_modes_find(&c->terms, &c->body, &c->work)
        || vi_coupled_modes_size(&c->terms, &c->body) > LARGEST_SIZE) {
        return false;
    }
    for (int m = 0; m < c->terms.terms; ++m) {
        double re = 0.0, im = 0.0;
        for (int i = 0; i < c->coupled; ++i) {
            re += c->terms.vector[m][i].re * c->terms.vector[m][i].re;
            im += c->terms.vector[m][i].im * c->terms.vector[m][i].im;
        }
        c->across[m] = c->terms.rate[m].im == 0.0 && im > re;
    }
    return true;
}

bool vi_lane_couple(struct vi_lane_coupling *c, int modes, const vi_lanes_points *points, int64_t point)
{
    order_modes(c, modes, points, point);
    if (c->coupled == 0) {
        c->terms.modes = c->terms.terms = 0;
        c->is_known = false;
        return true;
    }
    if (!fill_body(c, modes, points, point)) {
        return false;
    }
    /* a sweep of the force or of a stop has one body at all points */
    if (!c->is_known || memcmp(&c->body, &c->found, sizeof c->body) != 0) {
        memcpy(&c->found, &c->body, sizeof c->found);
        c->is_known = true;
        c->has_terms = find_terms(c);
    }
    return c->has_terms;
}

int vi_lane_own_mode(const struct vi_lane_coupling *c, int j)
{
    return j < c->own ? c->mode[j] : -1;
}

int vi_lane_rates(const struct vi_lane_coupling *c, vi_lane_rate rate[])
{
    int first = c->own;
    for (int m = 0; m < c->terms.terms; ++m) {
        rate[m] = (vi_lane_rate){c->terms.rate[m].re, c->terms.rate[m].im, first};
        first += c->terms.rate[m].im > 0.0 ? 2 : 1;
    }
    return c->terms.terms;
}

void vi_lane_split(const struct vi_lane_coupling *c, const double q[], const double p[], double real_q[],
                   double real_p[])
{
    double x[VI_LANES_MODES], v[VI_LANES_MODES];
    vi_complex part[VI_TERMS];
    memset(real_q, 0, VI_REAL_MODES * sizeof *real_q);
    memset(real_p, 0, VI_REAL_MODES * sizeof *real_p);
    for (int i = 0; i < c->own; ++i) {
        real_q[i] = q[c->mode[i]];
        real_p[i] = p[c->mode[i]];
    }
    for (int i = 0; i < c->coupled; ++i) {
        x[i] = q[c->mode[c->own + i]];
        v[i] = p[c->mode[c->own + i]];
    }
    vi_pressed_parts(&c->terms, x, v, part);
    for (int m = 0, j = c->own; m < c->terms.terms; ++m, ++j) {
        const vi_complex rise = vi_complex_multiply(c->terms.rate[m], part[m]);
        real_q[j] = c->across[m] ? part[m].im : part[m].re;
        real_p[j] = c->across[m] ? rise.im : rise.re;
        if (c->terms.rate[m].im > 0.0) {
            j += 1;
            real_q[j] = part[m].im;
            real_p[j] = rise.im;
        }
    }
}

void vi_lane_displacements(const struct vi_lane_coupling *c, int mode, double of[])
{
    memset(of, 0, VI_REAL_MODES * sizeof *of);
    for (int i = 0; i < c->own; ++i) {
        of[i] = c->mode[i] == mode ? 1.0 : 0.0;
    }
    for (int i = 0; i < c->coupled; ++i) {
        if (c->mode[c->own + i] != mode) {
            continue;
        }
        for (int m = 0, j = c->own; m < c->terms.terms; ++m, ++j) { /* Re(part vector) */
            of[j] = c->across[m] ? -c->terms.vector[m][i].im : c->terms.vector[m][i].re;
            if (c->terms.rate[m].im > 0.0) {
                j += 1;
                of[j] = -c->terms.vector[m][i].im;
            }
        }
    }
}
