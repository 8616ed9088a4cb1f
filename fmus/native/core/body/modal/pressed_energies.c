#include "body/modal/pressed_energies.h"

#include <math.h>

/* A movement with velocity scale vector e^(rate t): a term, the harmonic response, or a slope's response. */
typedef struct {
    vi_complex rate, scale, from, to; /* from, to: e^(rate t) at the start and at the end, times the initial value */
    const vi_complex *vector;
} mover;

typedef struct {
    const vi_structure *s;
    const vi_pressed_flow *flow;
    double length;
    int count;
    mover mover[VI_TERMS + 2];
    vi_complex slope[VI_MODES];
    double at_stop[VI_PORTS], damping_loss; /* of the dashpots, and of the body, J */
} sums;

/* ---- movements ---- */

static void collect(sums *sum)
{
    const vi_pressed_flow *flow = sum->flow;
    const vi_pressed_modes *modes = &flow->pressed->modes;
    const double w = flow->angular_frequency, first = flow->angle, last = first + w * sum->length;
    const vi_complex one = {1.0, 0.0}, none = {0.0, 0.0}, turning = {0.0, w};
    vi_complex from[VI_TERMS], to[VI_TERMS];
    vi_pressed_flow_parts(flow, 0.0, from);
    vi_pressed_flow_parts(flow, sum->length, to);
    for (int m = 0; m < modes->terms; ++m) {
        sum->mover[m] = (mover){modes->rate[m], modes->rate[m], from[m], to[m], modes->vector[m]};
    }
    for (int j = 0; j < modes->modes; ++j) {
        sum->slope[j] = (vi_complex){flow->level_rate[j], 0.0};
    }
    sum->count = modes->terms;
    sum->mover[sum->count++] = (mover){turning, turning, {cos(first), sin(first)}, {cos(last), sin(last)},
                                       flow->harmonic};
    sum->mover[sum->count++] = (mover){none, one, one, one, sum->slope};
}

/* weight . velocity */
static vi_complex seen(int modes, const mover *m, const double weight[])
{
    vi_complex sum = {0.0, 0.0};
    for (int j = 0; j < modes; ++j) {
        sum.re += weight[j] * m->vector[j].re;
        sum.im += weight[j] * m->vector[j].im;
    }
    return vi_complex_multiply(m->scale, sum);
}

/* ---- work of the loads ---- */

/* Work of the harmonic force, J. */
static double forcing_work(const sums *sum)
{
    const vi_structure_model *model = sum->s->model;
    const mover *turning = &sum->mover[sum->count - 2];
    double force[VI_MODES], work = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        force[j] = model->mode[j].force;
    }
    for (int i = 0; i < sum->count; ++i) {
        const mover *m = &sum->mover[i];
        const vi_complex power = vi_complex_scale(0.5, seen(vi_structure_modes(model), m, force));
        const vi_complex with = vi_product_integral(m->rate, m->from, m->to, turning->rate, turning->from, turning->to,
                                                    sum->length);
        const vi_complex against = vi_product_integral(m->rate, m->from, m->to, vi_complex_conjugate(turning->rate),
                                                       vi_complex_conjugate(turning->from),
                                                       vi_complex_conjugate(turning->to), sum->length);
        work += vi_complex_multiply(power, vi_complex_add(with, against)).re;
    }
    return work;
}

/* Work of the loads that the inputs hold and of their slopes since displacements q, J. By parts, a slope's work is its
 * growth times the final displacement, less the integral of slope times displacement. */
static double load_work(const sums *sum, const double q[])
{
    const vi_structure *s = sum->s;
    const double u = sum->length, *rate = s->state->held_rate;
    double held[VI_MODES], still = 0.0, grown = 0.0;
    vi_structure_held_now(s, held);
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        const double moved = s->state->q[j] - q[j];
        still += held[j] * moved;
        grown += rate[j] * (u * (s->state->q[j] - sum->flow->level[j] - 0.5 * u * sum->flow->level_rate[j]));
    }
    for (int i = 0; i < sum->count - 1; ++i) { /* integral of the displacement without its level */
        const mover *m = &sum->mover[i];
        vi_complex way = {0.0, 0.0};
        for (int j = 0; j < vi_structure_modes(s->model); ++j) {
            way = vi_complex_add(way, vi_complex_scale(rate[j], m->vector[j]));
        }
        grown -= vi_complex_multiply(way, vi_term_integral(m->rate, m->from, m->to, u)).re;
    }
    return still + grown;
}

/* ---- losses of the dampings ---- */

/* Real part of the integral of Re(a e) Re(b f) for movements e and f. `same`: integral of e f; `across`: integral of e
 * f*; `product`: a b; `mixed`: a b*. */
static double share(vi_complex product, vi_complex same, vi_complex mixed, vi_complex across)
{
    return 0.5 * (vi_complex_multiply(product, same).re + vi_complex_multiply(mixed, across).re);
}

/* Add the losses of a pair of movements a and b. */
static void add_pair(sums *sum, const mover *a, const mover *b, const vi_complex drag[], const vi_complex at_a[],
                     const vi_complex at_b[], double times)
{
    const vi_pressed_body *body = &sum->flow->pressed->body;
    const vi_complex same = vi_product_integral(a->rate, a->from, a->to, b->rate, b->from, b->to, sum->length);
    const vi_complex across = vi_product_integral(a->rate, a->from, a->to, vi_complex_conjugate(b->rate),
                                                  vi_complex_conjugate(b->from), vi_complex_conjugate(b->to),
                                                  sum->length);
    vi_complex product = {0.0, 0.0}, mixed = {0.0, 0.0};
    for (int j = 0; j < body->modes; ++j) {
        product = vi_complex_add(product, vi_complex_multiply(a->vector[j], drag[j]));
        mixed = vi_complex_add(mixed, vi_complex_multiply(a->vector[j], vi_complex_conjugate(drag[j])));
    }
    product = vi_complex_multiply(a->scale, product);
    mixed = vi_complex_multiply(a->scale, mixed);
    sum->damping_loss += times * share(product, same, mixed, across);
    for (int i = 0; i < body->contacts; ++i) {
        product = vi_complex_multiply(at_a[i], at_b[i]);
        mixed = vi_complex_multiply(at_a[i], vi_complex_conjugate(at_b[i]));
        sum->at_stop[i] += body->held[i] ? 0.0 : times * body->damping[i] * share(product, same, mixed, across);
    }
}

/* Force with which the body's damping opposes a velocity. */
static void drag_of(const vi_pressed_body *body, const mover *m, vi_complex drag[])
{
    double re[VI_MODES], im[VI_MODES];
    for (int j = 0; j < body->modes; ++j) {
        const vi_complex velocity = vi_complex_multiply(m->scale, m->vector[j]);
        re[j] = velocity.re;
        im[j] = velocity.im;
    }
    for (int j = 0; j < body->modes; ++j) {
        drag[j] = (vi_complex){vi_pressed_drag(body, j, re), vi_pressed_drag(body, j, im)};
    }
}

static void add_losses(sums *sum)
{
    const vi_pressed_body *body = &sum->flow->pressed->body;
    vi_complex at[VI_TERMS + 2][VI_PORTS], drag[VI_MODES];
    for (int l = 0; l < sum->count; ++l) {
        const mover *b = &sum->mover[l];
        drag_of(body, b, drag);
        for (int i = 0; i < body->contacts; ++i) {
            at[l][i] = seen(body->modes, b, body->shape[i]);
        }
        for (int m = 0; m <= l; ++m) {
            add_pair(sum, &sum->mover[m], b, drag, at[m], at[l], m < l ? 2.0 : 1.0);
        }
    }
}

/* ---- a rest ---- */

/* Energy stored in a spring since displacements q, J. */
static double spring_work(const vi_structure *s, int k, double stiffness, const double q[])
{
    const double sign = vi_structure_direction(s, k), *shape = s->model->shape[k];
    const double before = sign * (vi_structure_at(s->model, shape, q) - s->contacts[k].position);
    const double after = sign * (vi_structure_at(s->model, shape, s->state->q) - s->contacts[k].position);
    return 0.5 * stiffness * (after - before) * (after + before);
}

void vi_energies_of_rest(const vi_structure *s, const vi_pressed_flow *flow, const double q[], double u)
{
    const vi_pressed_body *body = &flow->pressed->body;
    vi_energies *energies = &s->state->energies;
    sums sum = {.s = s, .flow = flow, .length = u};
    vi_budget_spend(&s->state->budget, (int64_t)flow->pressed->modes.terms * flow->pressed->modes.terms);
    collect(&sum);
    add_losses(&sum);
    energies->forcing_work += forcing_work(&sum) + load_work(&sum, q);
    energies->damping_loss += sum.damping_loss;
    for (int i = 0; i < body->contacts; ++i) {
        const double work = spring_work(s, flow->pressed->port[i], body->stiffness[i], q);
        energies->contact_loss += body->held[i] ? 0.0 : work + sum.at_stop[i];
    }
}
