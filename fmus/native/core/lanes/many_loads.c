#include "lanes/many_loads.h"

#include <math.h>

#include "lanes/lane_sines.h"
#include "lanes/lane_turn.h"
#include "lanes/many_coupling.h"
#include "motion/complex.h"
#include "motion/flow.h"

/* Largest steady response, in units of the force's effect within one radian; a larger one costs as many roundings. */
static const double LARGEST_STEADY = 1000.0;

/* Loads and state of the modes of a point. */
typedef struct {
    double force[VI_LANES_MODES], held[VI_LANES_MODES];
    double further[VI_FURTHER_SINES][VI_LANES_MODES]; /* forces of the further sines */
    const double *q, *p;
} modal_loads;

/* Has the mode a steady response to its force that keeps the digits of its motion? */
static bool has_steady(const vi_mode *mode)
{
    return (mode->force == 0.0 || mode->steady_exists)
           && mode->steady_amplitude * mode->fastest * mode->fastest <= LARGEST_STEADY * fabs(mode->force);
}

/* Set a mode and its response to the force; false where lockstep cannot follow it. */
static bool take_mode(vi_lane_group *g, int lane, int j, const vi_mode *mode, double held, double q, double p)
{
    vi_many_modes *many = &g->many;
    const double c = mode->steady_cos, n = mode->steady_sin, w = mode->angular_frequency;
    const bool has_spring = mode->stiffness > 0.0;
    if ((!has_spring && held != 0.0) || !has_steady(mode)) {
        return false;
    }
    double cosine, sine;
    vi_lane_turn(w * g->rest[lane], &cosine, &sine);
    many->stiffness[j][lane] = mode->stiffness;
    many->decay[j][lane] = mode->decay;
    many->steady_cosine[j][lane] = c;
    many->steady_sine[j][lane] = n;
    many->rest[j][lane] = has_spring ? held / mode->stiffness : 0.0;
    g->q[j][lane] = q - ((c * cosine + n * sine) + many->rest[j][lane]);
    g->p[j][lane] = p - w * (n * cosine - c * sine);
    return isfinite(g->q[j][lane]) && isfinite(g->p[j][lane]);
}

/* Set the responses of a mode without coupling to the further sines, and take them off its motion; false where they cost
 * digits. `forces`: of each sine on this mode. */
static bool take_responses(vi_lane_group *g, int lane, int j, const vi_mode *mode, const double forces[])
{
    const vi_lane_phases phases = vi_lane_phases_at(g, lane, g->periods[lane], g->rest[lane]);
    for (int k = 0; k < vi_further_sines(g); ++k) {
        const double w = g->sines->angular_frequency[k][lane];
        const double cosine = phases.of[k][VI_OF_ITS_COSINE], sine = phases.of[k][VI_OF_ITS_SINE];
        vi_mode driven = *mode;
        vi_mode_drive(&driven, forces[k], w);
        if (!isfinite(forces[k]) || !has_steady(&driven)) {
            return false;
        }
        const double c = driven.steady_cos, n = driven.steady_sin;
        g->sines->steady[k][j][VI_OF_ITS_COSINE][lane] = c;
        g->sines->steady[k][j][VI_OF_ITS_SINE][lane] = n;
        g->q[j][lane] -= c * cosine + n * sine;
        g->p[j][lane] -= w * (n * cosine - c * sine);
    }
    return isfinite(g->q[j][lane]) && isfinite(g->p[j][lane]);
}

/* Response c cos + n sin of z' = rate z + load cos to a load of angular frequency w; false where it costs digits. */
static bool respond(vi_complex rate, vi_complex load, double w, vi_complex *c, vi_complex *n)
{
    const vi_complex below = {rate.re * rate.re - rate.im * rate.im + w * w, 2.0 * rate.re * rate.im}; /* rate^2 + w^2 */
    *c = *n = (vi_complex){0.0, 0.0};
    if (load.re != 0.0 || load.im != 0.0) {
        const vi_complex unit = vi_complex_divide(load, below);
        *c = vi_complex_scale(-1.0, vi_complex_multiply(rate, unit));
        *n = vi_complex_scale(w, unit);
    }
    const double size = vi_complex_size(*c) + vi_complex_size(*n), square = rate.re * rate.re + rate.im * rate.im;
    return size * sqrt(square) <= LARGEST_STEADY * vi_complex_size(load);
}

/* Set the responses of a complex mode to the further sines, and take them off its motion; false where they cost digits.
 * further[k]: load of each sine as split velocities. */
static bool take_rate_responses(vi_lane_group *g, int lane, const vi_lane_rate *rate, double further[][VI_REAL_MODES],
                                vi_complex *x)
{
    const int j = rate->first, parts = rate->im > 0.0 ? 2 : 1;
    const vi_lane_phases phases = vi_lane_phases_at(g, lane, g->periods[lane], g->rest[lane]);
    for (int k = 0; k < vi_further_sines(g); ++k) {
        const vi_complex load = {further[k][j], parts > 1 ? further[k][j + 1] : 0.0}, s = {rate->re, rate->im};
        const double cosine = phases.of[k][VI_OF_ITS_COSINE], sine = phases.of[k][VI_OF_ITS_SINE];
        vi_complex c, n;
        if (!respond(s, load, g->sines->angular_frequency[k][lane], &c, &n)) {
            return false;
        }
        for (int part = 0; part < parts; ++part) {
            g->sines->steady[k][j + part][VI_OF_ITS_COSINE][lane] = part ? c.im : c.re;
            g->sines->steady[k][j + part][VI_OF_ITS_SINE][lane] = part ? n.im : n.re;
        }
        x->re -= c.re * cosine + n.re * sine;
        x->im -= c.im * cosine + n.im * sine;
    }
    return true;
}

/* Set the real modes of a complex mode, and their responses to force and held load; false where lockstep cannot follow
 * them. `start_q`: displacements at the start; `force`, `held`: loads of z' = rate z + load, as split velocities. */
static bool take_rate(vi_lane_group *g, int lane, const vi_lane_rate *rate, vi_mode mode[], const double start_q[],
                      const double force[], const double held[], double further[][VI_REAL_MODES])
{
    vi_many_modes *many = &g->many;
    const double w = g->angular_frequency[lane], square = rate->re * rate->re + rate->im * rate->im;
    const int j = rate->first, parts = rate->im > 0.0 ? 2 : 1;
    const vi_complex s = {rate->re, rate->im}, b = {force[j], parts > 1 ? force[j + 1] : 0.0};
    const vi_complex z = {start_q[j], parts > 1 ? start_q[j + 1] : 0.0}, h = {held[j], parts > 1 ? held[j + 1] : 0.0};
    vi_complex c, n, cosine_sine;
    if (!respond(s, b, w, &c, &n)) {
        return false;
    }
    vi_lane_turn(w * g->rest[lane], &cosine_sine.re, &cosine_sine.im);
    const vi_complex rest = vi_complex_scale(-1.0, vi_complex_divide(h, s));
    vi_complex x = {z.re - ((c.re * cosine_sine.re + n.re * cosine_sine.im) + rest.re),
                    z.im - ((c.im * cosine_sine.re + n.im * cosine_sine.im) + rest.im)};
    if (!take_rate_responses(g, lane, rate, further, &x)) {
        return false;
    }
    const vi_complex v = vi_complex_multiply(s, x);
    for (int part = 0; part < parts; ++part) {
        vi_mode_start(&mode[j + part], 1.0, -2.0 * s.re, square, 0.0, w);
        many->stiffness[j + part][lane] = square;
        many->decay[j + part][lane] = 0.0 - s.re;
        many->steady_cosine[j + part][lane] = part ? c.im : c.re;
        many->steady_sine[j + part][lane] = part ? n.im : n.re;
        many->rest[j + part][lane] = part ? rest.im : rest.re;
        g->q[j + part][lane] = part ? x.im : x.re;
        g->p[j + part][lane] = part ? v.im : v.re;
    }
    return isfinite(c.re) && isfinite(c.im) && isfinite(n.re) && isfinite(n.im) && isfinite(x.re) && isfinite(x.im) && isfinite(v.re) && isfinite(v.im);
}

/* Set mode `from` as real mode j. */
static bool take_own(vi_lane_group *g, int lane, int j, const vi_lanes_points *points, int64_t point,
                     const modal_loads *of, int from, vi_mode *mode)
{
    const int64_t i = from * points->count + point;
    vi_mode_start(mode, 1.0, 2.0 * points->decay[i], points->stiffness[i], of->force[from], g->angular_frequency[lane]);
    double forces[VI_FURTHER_SINES];
    for (int k = 0; k < vi_further_sines(g); ++k) {
        forces[k] = of->further[k][from];
    }
    return take_mode(g, lane, j, mode, of->held[from], of->q[from], of->p[from])
           && take_responses(g, lane, j, mode, forces);
}

/* Set the real modes of a body whose damping may couple its modes; unused ones stay at rest. */
static bool take_coupled(vi_lane_group *g, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points,
                         int64_t point, const modal_loads *of, vi_mode mode[])
{
    const double none[VI_LANES_MODES] = {0.0};
    double unused[VI_REAL_MODES], q[VI_REAL_MODES], force[VI_REAL_MODES], held[VI_REAL_MODES], row[VI_REAL_MODES];
    double further[VI_FURTHER_SINES][VI_REAL_MODES];
    vi_lane_rate rate[VI_REAL_MODES];
    if (!vi_lane_couple(g->coupling, plan->modes, points, point)) {
        return false;
    }
    for (int i = 0; i < plan->modes; ++i) {
        vi_lane_displacements(g->coupling, i, row);
        for (int j = 0; j < vi_own_modes(plan); ++j) {
            g->many.to_state[i][j][lane] = row[j];
        }
    }
    vi_lane_split(g->coupling, of->q, of->p, q, unused);
    vi_lane_split(g->coupling, none, of->force, force, unused);
    vi_lane_split(g->coupling, none, of->held, held, unused);
    for (int k = 0; k < plan->further; ++k) {
        vi_lane_split(g->coupling, none, of->further[k], further[k], unused);
    }
    bool good = true;
    for (int j = 0; j < vi_own_modes(plan) && good; ++j) {
        const int own = vi_lane_own_mode(g->coupling, j);
        vi_mode_start(&mode[j], 1.0, 0.0, 0.0, 0.0, g->angular_frequency[lane]);
        good = own < 0 ? take_mode(g, lane, j, &mode[j], 0.0, 0.0, 0.0)
                       : take_own(g, lane, j, points, point, of, own, &mode[j]);
    }
    const int rates = vi_lane_rates(g->coupling, rate);
    for (int m = 0; m < rates && good; ++m) {
        good = take_rate(g, lane, &rate[m], mode, q, force, held, further);
    }
    return good;
}

/* Set the two undamped modes of each further sine. Lockstep sets their states from the clock. */
static void take_sine_modes(vi_lane_group *g, int lane, const vi_lanes_plan *plan, vi_mode mode[])
{
    vi_many_modes *many = &g->many;
    for (int j = vi_own_modes(plan); j < vi_real_modes(plan); ++j) {
        const double w = g->sines->angular_frequency[(j - vi_own_modes(plan)) / 2][lane];
        vi_mode_start(&mode[j], 1.0, 0.0, w * w, 0.0, g->angular_frequency[lane]);
        many->stiffness[j][lane] = w * w;
        many->decay[j][lane] = many->rest[j][lane] = 0.0;
        many->steady_cosine[j][lane] = many->steady_sine[j][lane] = 0.0;
    }
}

bool vi_lane_take_modes(vi_lane_group *g, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points,
                        int64_t point, const double q[], const double p[], vi_mode mode[])
{
    modal_loads of = {.q = q, .p = p};
    bool good = true;
    for (int j = 0; j < plan->modes; ++j) {
        of.force[j] = points->force[j * points->count + point];
        of.held[j] = points->held[j * points->count + point];
        good = good && isfinite(of.force[j]) && isfinite(of.held[j]);
        for (int k = 0; k < plan->further; ++k) {
            of.further[k][j] = points->further_force[(k * plan->modes + j) * points->count + point];
            good = good && isfinite(of.further[k][j]);
        }
    }
    take_sine_modes(g, lane, plan, mode);
    if (plan->coupled) {
        return good && take_coupled(g, lane, plan, points, point, &of, mode);
    }
    for (int j = 0; j < plan->modes && good; ++j) {
        good = take_own(g, lane, j, points, point, &of, j, &mode[j]);
    }
    return good;
}
