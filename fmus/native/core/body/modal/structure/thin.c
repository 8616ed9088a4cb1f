#include "body/modal/structure/thin.h"

#include <float.h>
#include <math.h>

#include "body/modal/forces.h"
#include "contact/complementarity.h"
#include "motion/majorant.h"

/* Relative change of a depth below which the depth hardly changes and quadrature replaces differences of powers. */
static const double SMALL_CHANGE = 0.1;

/* Upper bound of the rate at which the applied load of mode j changes within a radian. */
static double load_rate(const vi_structure *s, int j)
{
    const vi_mode *mode = &s->model->mode[j];
    double rate = fabs(mode->force) * s->model->clock.angular_frequency + fabs(s->state->held_rate[j]), power = 1.0;
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        rate += fabs(mode->further[k].force) * mode->further[k].angular_frequency;
    }
    for (int n = 2; n <= vi_structure_degree(s); ++n) {
        power *= vi_min(s->model->radian, s->state->loads_last);
        rate += (double)n * fabs(s->state->higher[n - 2][j]) * power;
    }
    return rate;
}

/* Upper bound of the rate at which the other forces change the modal accelerations, m/s^3 kg^(1/2). A projection on
 * held stops makes it no longer. */
static double jerk_size(const vi_structure *s, int k, const double acceleration[])
{
    const vi_structure_model *model = s->model;
    double square = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        const double damped = model->coupled ? vi_structure_at(model, model->coupling[j], acceleration)
                                             : 2.0 * mode->decay * acceleration[j];
        const double jerk = load_rate(s, j) + fabs(mode->stiffness * s->state->p[j] + damped);
        square += jerk * jerk;
    }
    double size = sqrt(square);
    for (int l = 0; l < model->contacts; ++l) {
        if (l != k && s->state->status[l] == VI_CONTACT_YIELDING) {
            const double rate = vi_structure_approach(s, l), a = vi_structure_at(model, model->shape[l], acceleration);
            const vi_contact_force slopes = vi_structure_yield(s, l);
            size += sqrt(model->compliance[l][l]) * (slopes.stiffness * fabs(rate) + slopes.damping * fabs(a));
        }
    }
    return size;
}

/* Time for which the force may act as that of a penetration at constant rate, within the tolerance; at most `longest`.
 * The search ends below `least`. */
static double accurate_time(const vi_structure *s, int k, double rate, const double acceleration[], double longest,
                            double least)
{
    const vi_press press = vi_structure_press(s, k);
    const double n = press.exponent, stiffness = press.stiffness * s->model->compliance[k][k];
    const double speed = fabs(rate), pull = fabs(vi_structure_at(s->model, s->model->shape[k], acceleration));
    const double jerk = jerk_size(s, k, acceleration) * sqrt(s->model->compliance[k][k]);
    const double fastest = s->model->fastest, tolerance = s->model->tolerance;
    double t = longest;
    for (int halving = 0; halving < 1000 && t > least; ++halving, t *= 0.5) {
        const double turn = (pull + 0.5 * jerk * t) * t; /* largest change of the rate by all other forces */
        const double depth = (speed + (0.5 * pull + jerk * t / 6.0) * t) * t;
        const double plain = stiffness * pow(depth, n) * t;
        const double most = plain * vi_max(0.0, 1.0 + press.damping * (rate + turn)); /* velocity change */
        const double turned = turn + speed * (fastest * t) * (fastest * t);
        const double error = (most * n + plain * press.damping * speed) * (turned + most);
        if (most <= tolerance * (speed + turn) || error <= tolerance * speed * speed) {
            vi_budget_spend(&s->state->budget, halving);
            return t;
        }
    }
    return t;
}

double vi_thin_time(const vi_structure *s, int k, double rate, const double acceleration[], double least)
{
    const double longest = s->model->fastest > 0.0 ? 1.0 / s->model->fastest : 1.0;
    const double accurate = accurate_time(s, k, rate, acceleration, longest, least);
    const double rounding = DBL_EPSILON * vi_structure_displacement_size(s, k);
    const double moves = rate != 0.0 ? vi_min(rounding / fabs(rate), longest) : 0.0;
    if (moves <= accurate) {
        return accurate;
    }
    /* a rate of rounding size does not move it */
    const double pull = fabs(vi_structure_at(s->model, s->model->shape[k], acceleration));
    const double jerk = jerk_size(s, k, acceleration) * sqrt(s->model->compliance[k][k]);
    const double turned = vi_min(sqrt(2.0 * rounding / pull), cbrt(6.0 * rounding / jerk));
    return vi_max(accurate, vi_min(moves, turned));
}

bool vi_thin_lasts(const vi_structure *s, int k, double rate, const double acceleration[], double time)
{
    const double damping = vi_structure_press(s, k).damping;
    if (damping == 0.0) {
        return true;
    }
    const double pull = fabs(vi_structure_at(s->model, s->model->shape[k], acceleration));
    const double jerk = jerk_size(s, k, acceleration) * sqrt(s->model->compliance[k][k]);
    return 1.0 + damping * (rate - (pull + 0.5 * jerk * time) * time) > 0.0;
}

/* Integral of max(0, depth + rate t)^n over u seconds; *moment: integral of its effect on the displacement. */
static double integrate(double n, double depth, double rate, double u, double *moment)
{
    static const double NODES[] = {0.1127016653792583, 0.5, 0.8872983346207417}, WEIGHTS[] = {5.0, 8.0, 5.0};
    const double after = vi_max(0.0, depth + rate * u), start = pow(vi_max(0.0, depth), n + 1.0);
    double sum = 0.0;
    *moment = 0.0;
    if (fabs(rate * u) >= SMALL_CHANGE * fabs(depth) && fabs(rate) > DBL_MIN / DBL_EPSILON) {
        sum = (pow(after, n + 1.0) - start) / ((n + 1.0) * rate);
        *moment = ((pow(after, n + 2.0) - start * vi_max(0.0, depth)) / ((n + 2.0) * rate) - start * u)
                  / ((n + 1.0) * rate);
        return sum;
    }
    for (int i = 0; i < 3; ++i) { /* the depth hardly changes: differences of its powers would be rounding */
        const double part = WEIGHTS[i] / 18.0 * u * pow(vi_max(0.0, depth + rate * u * NODES[i]), n);
        sum += part;
        *moment += part * u * (1.0 - NODES[i]);
    }
    return sum;
}

void vi_thin_impulse(const vi_structure *s, int k, double depth, double rate, double u)
{
    const vi_press press = vi_structure_press(s, k);
    const double strength = press.stiffness * vi_max(0.0, 1.0 + press.damping * rate);
    double moment;
    const double whole = strength * integrate(press.exponent, depth, rate, u, &moment);
    const double stopping = vi_max(0.0, vi_structure_approach(s, k)) / s->model->compliance[k][k];
    /* at most the impulse that stops the contact: a larger one, below the displacement's rounding, throws it back */
    const double impulse = rate > 0.0 ? vi_min(whole, stopping) : whole;
    vi_structure_push(s, k, impulse, s->state->p);
    vi_structure_push(s, k, impulse < whole ? strength * moment * (impulse / whole) : strength * moment, s->state->q);
    s->state->touch_down[k].impulse += impulse;
    if (vi_structure_follows_peak(s, k)) {
        const double deepest = vi_max(vi_max(0.0, depth), depth + rate * u);
        const double largest = strength * pow(deepest, press.exponent);
        s->state->touch_down[k].peak = vi_max(s->state->touch_down[k].peak, largest);
    }
}

double vi_thin_part(const vi_structure *s, const vi_drift *drift, const int thin[], const double at[], int k, double u,
                    double *size)
{
    double g[VI_PORTS][VI_PORTS], column[VI_PORTS], share[VI_PORTS], sum = 0.0;
    int held[VI_PORTS] = {0};
    *size = 0.0;
    vi_structure_signed(s, s->model->compliance, g);
    for (int l = 0; l < s->model->contacts; ++l) {
        held[l] = s->state->status[l] == VI_CONTACT_HELD;
    }
    for (int l = 0; l < s->model->contacts; ++l) {
        if (thin[l]) {
            const vi_press press = vi_structure_press(s, l);
            const double rate = drift->penetration[l][1], depth = vi_max(0.0, at[l] + rate * u);
            const double force = press.stiffness * pow(depth, press.exponent) * vi_max(0.0, 1.0 + press.damping * rate);
            for (int i = 0; i < s->model->contacts; ++i) {
                column[i] = g[i][l];
            }
            vi_solve_active(s->model->contacts, g, column, held, share);
            sum -= share[k] * force;
            *size += fabs(share[k] * force);
        }
    }
    return sum;
}
