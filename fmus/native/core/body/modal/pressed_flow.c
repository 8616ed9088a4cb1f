#include "body/modal/pressed_flow.h"

#include <math.h>
#include <string.h>

#include "modes/pressed_response.h"
#include "motion/ripple.h"

/* The response may be this many times larger than the motion: it takes so many roundings off it. */
static const double LARGEST_RESPONSE = 64.0;
/* Below this many radians the integral of a term is its series: else the difference of its ends is rounding. */
static const double SHORT = 0.5;
enum { SERIES = 14 };

/* ---- modes, kept ---- */

static bool rests_as(const vi_pressed *pressed, const vi_structure_model *model, const vi_pressed_body *body)
{
    const size_t size = (size_t)model->modes * sizeof(double);
    bool same = pressed->known && pressed->contacts == model->contacts && pressed->body.modes == body->modes
                && pressed->body.held == body->held && pressed->body.stiffness == body->stiffness
                && pressed->body.damping == body->damping && memcmp(pressed->body.square, body->square, size) == 0
                && memcmp(pressed->body.decay, body->decay, size) == 0
                && memcmp(pressed->body.shape, body->shape, size) == 0
                && memcmp(pressed->observed, model->observed, size) == 0;
    for (int l = 0; l < model->contacts && same; ++l) {
        same = memcmp(pressed->shape[l], model->shape[l], size) == 0;
    }
    return same;
}

static void weigh(const vi_pressed_modes *modes, const double shape[], vi_complex weight[])
{
    for (int m = 0; m < modes->terms; ++m) {
        weight[m] = (vi_complex){0.0, 0.0};
        for (int j = 0; j < modes->modes; ++j) {
            weight[m].re += shape[j] * modes->vector[m][j].re;
            weight[m].im += shape[j] * modes->vector[m][j].im;
        }
    }
}

static void weigh_all(vi_pressed *pressed, const vi_structure_model *model)
{
    for (int l = 0; l < model->contacts; ++l) {
        weigh(&pressed->modes, model->shape[l], pressed->weight[l]);
    }
    weigh(&pressed->modes, model->observed, pressed->weight[VI_SEEN_OBSERVED]);
    for (int m = 0; m < pressed->modes.terms; ++m) {
        pressed->weight[VI_SEEN_FORCE][m] = (vi_complex){pressed->modes.force[m], 0.0};
    }
}

static void describe(const vi_structure *s, int k, vi_pressed_body *body)
{
    const vi_structure_model *model = s->model;
    const vi_contact_law *law = &s->contacts[k].law;
    const bool held = s->state->status[k] == VI_CONTACT_HELD;
    body->modes = model->modes;
    body->held = held;
    body->stiffness = held ? 0.0 : law->stiffness;
    body->damping = held ? 0.0 : law->damping;
    for (int j = 0; j < model->modes; ++j) {
        body->square[j] = model->mode[j].stiffness;
        body->decay[j] = 0.5 * vi_structure_damping(model, j, j);
        body->shape[j] = vi_structure_direction(s, k) * model->shape[k][j];
    }
}

const vi_pressed *vi_pressed_find(const vi_structure *s, int k)
{
    const vi_structure_model *model = s->model;
    vi_pressed *pressed = s->pressed;
    vi_pressed_body body;
    describe(s, k, &body);
    if (!rests_as(pressed, model, &body)) {
        pressed->known = 1;
        pressed->contacts = model->contacts;
        pressed->body = body;
        memcpy(pressed->shape, model->shape, sizeof pressed->shape);
        memcpy(pressed->observed, model->observed, sizeof pressed->observed);
        pressed->usable = vi_pressed_modes_find(&pressed->modes, &pressed->body);
        if (pressed->usable) {
            weigh_all(pressed, model);
        }
    }
    return pressed->usable ? pressed : NULL;
}

/* ---- the flow ---- */

/* The responses to the harmonic force and to the loads from `at` on with their slopes; `position`: of the stop,
 * towards it. */
static void respond(vi_pressed_flow *flow, const vi_structure *s, const double held[], double position)
{
    const vi_pressed_body *body = &flow->pressed->body;
    const vi_complex none = {0.0, 0.0};
    vi_complex load[VI_MODES], found[VI_MODES], force;
    double rate = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        load[j] = (vi_complex){s->model->mode[j].force, 0.0};
    }
    vi_pressed_response(body, (vi_complex){0.0, flow->angular_frequency}, load, none, flow->harmonic,
                        &flow->harmonic_force);
    for (int j = 0; j < body->modes; ++j) {
        load[j] = (vi_complex){s->state->held_rate[j], 0.0};
    }
    vi_pressed_response(body, none, load, none, found, &force);
    flow->force_rate = force.re;
    for (int j = 0; j < body->modes; ++j) {
        flow->level_rate[j] = found[j].re;
        load[j] = (vi_complex){held[j] - 2.0 * body->decay[j] * found[j].re, 0.0};
        rate += body->shape[j] * found[j].re;
    }
    const double behind = body->held ? 0.0 : body->damping * rate / body->stiffness;
    vi_pressed_response(body, none, load, (vi_complex){position - behind, 0.0}, found, &force);
    flow->force_level = force.re;
    for (int j = 0; j < body->modes; ++j) {
        flow->level[j] = found[j].re;
    }
}

/* Does the response leave the motion its digits, in displacements and in the velocities that they turn into? */
static bool keeps_digits(const vi_pressed_flow *flow, const vi_structure *s, double length)
{
    const vi_pressed_body *body = &flow->pressed->body;
    const double slow = vi_complex_size(flow->pressed->modes.rate[0]), w = flow->angular_frequency;
    double way = 0.0, speed = 0.0, response = 0.0, response_speed = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        const double natural = sqrt(body->square[j]), rate = vi_max(natural, slow);
        const double harmonic = vi_complex_size(flow->harmonic[j]);
        const double still = fabs(flow->level[j]) + length * fabs(flow->level_rate[j]);
        way += fabs(s->state->q[j]) + fabs(s->state->p[j]) / vi_max(natural, 1.0 / length);
        speed += fabs(s->state->p[j]) + rate * fabs(s->state->q[j]);
        response += harmonic + still;
        response_speed += (rate + w) * harmonic + rate * still;
    }
    return response <= LARGEST_RESPONSE * way && response_speed <= LARGEST_RESPONSE * speed;
}

bool vi_pressed_flow_start(vi_pressed_flow *flow, const vi_structure *s, int k, const vi_pressed *pressed,
                           double length)
{
    const vi_phase phase = vi_structure_phase(s);
    const double w = s->model->clock.angular_frequency;
    double held[VI_MODES], q[VI_MODES], p[VI_MODES];
    flow->pressed = pressed;
    flow->angle = phase.angle;
    flow->angular_frequency = w;
    flow->since = flow->since_low = 0.0;
    vi_structure_held_now(s, held);
    respond(flow, s, held, vi_structure_direction(s, k) * s->contacts[k].position);
    for (int j = 0; j < pressed->body.modes; ++j) {
        const vi_complex harmonic = flow->harmonic[j];
        const double x = harmonic.re * phase.cosine - harmonic.im * phase.sine;
        const double v = -w * (harmonic.re * phase.sine + harmonic.im * phase.cosine);
        q[j] = s->state->q[j] - flow->level[j] - x;
        p[j] = s->state->p[j] - flow->level_rate[j] - v;
    }
    vi_pressed_parts(&pressed->modes, &pressed->body, q, p, flow->part);
    return keeps_digits(flow, s, length);
}

/* Nothing but the exact flow has moved the body since, under the same loads. */
static bool goes_on(const vi_pressed_flow *flow, const vi_structure *s, int k, const double held[])
{
    const vi_rest_origin *origin = &s->state->rest;
    const vi_pressed_body *body = &flow->pressed->body;
    if (origin->contact != k + 1 || origin->stiffness != body->stiffness || origin->damping != body->damping
        || origin->position != s->contacts[k].position || s->model->varies) {
        return false;
    }
    for (int j = 0; j < body->modes; ++j) {
        if (s->state->q[j] != origin->reached_q[j] || s->state->p[j] != origin->reached_p[j]
            || held[j] != origin->held[j] || s->state->held_rate[j] != 0.0) {
            return false;
        }
    }
    return true;
}

void vi_pressed_flow_follow(vi_pressed_flow *flow, const vi_structure *s, int k)
{
    vi_rest_origin *origin = &s->state->rest;
    const vi_pressed_body *body = &flow->pressed->body;
    double held[VI_MODES];
    vi_structure_held_now(s, held);
    if (goes_on(flow, s, k, held)) {
        memcpy(flow->part, origin->part, sizeof flow->part);
        flow->since = vi_clock_elapsed_twofold(&s->model->clock, origin->at, s->state->now, &flow->since_low);
        return;
    }
    memset(origin, 0, sizeof *origin);
    origin->at = s->state->now;
    memcpy(origin->part, flow->part, (size_t)flow->pressed->modes.terms * sizeof flow->part[0]);
    memcpy(origin->held, held, (size_t)body->modes * sizeof held[0]);
    origin->position = s->contacts[k].position;
    origin->stiffness = body->stiffness;
    origin->damping = body->damping;
    origin->contact = k + 1;
}

void vi_pressed_flow_reach(const vi_structure *s)
{
    const size_t size = (size_t)s->model->modes * sizeof(double);
    memcpy(s->state->rest.reached_q, s->state->q, size);
    memcpy(s->state->rest.reached_p, s->state->p, size);
}

void vi_pressed_flow_parts(const vi_pressed_flow *flow, double u, vi_complex part[])
{
    const vi_pressed_modes *modes = &flow->pressed->modes;
    const double time = flow->since + u, added = time - flow->since;
    const double low = (flow->since - (time - added)) + (u - added) + flow->since_low;
    for (int m = 0; m < modes->terms; ++m) {
        const vi_complex rate = modes->rate[m];
        const double left = exp(rate.re * time), angle = rate.im * time;
        const double rest = fma(rate.im, time, -angle) + rate.im * low, c = cos(angle), sn = sin(angle);
        part[m] = vi_complex_multiply(flow->part[m], (vi_complex){left * (c - rest * sn), left * (sn + rest * c)});
    }
}

void vi_pressed_flow_end(const vi_pressed_flow *flow, double u, double q[], double p[])
{
    const double w = flow->angular_frequency, c = cos(flow->angle + w * u), sn = sin(flow->angle + w * u);
    vi_complex part[VI_TERMS];
    vi_pressed_flow_parts(flow, u, part);
    vi_pressed_sum(&flow->pressed->modes, part, q, p);
    for (int j = 0; j < flow->pressed->body.modes; ++j) {
        const vi_complex harmonic = flow->harmonic[j];
        q[j] += (harmonic.re * c - harmonic.im * sn) + (flow->level[j] + flow->level_rate[j] * u);
        p[j] += flow->level_rate[j] - w * (harmonic.re * sn + harmonic.im * c);
    }
}

/* (e^(rate u) - 1) / rate of a term that is `start` at first and `end` at last. */
static double integral(vi_complex rate, vi_complex start, vi_complex end, double u)
{
    if (vi_complex_size(rate) * u > SHORT) {
        return vi_complex_divide(vi_complex_subtract(end, start), rate).re;
    }
    vi_complex term = vi_complex_scale(u, start), sum = term;
    for (int n = 2; n < SERIES; ++n) {
        term = vi_complex_scale(u / (double)n, vi_complex_multiply(rate, term));
        sum = vi_complex_add(sum, term);
    }
    return sum.re;
}

double vi_pressed_flow_impulse(const vi_pressed_flow *flow, double u)
{
    const vi_pressed_modes *modes = &flow->pressed->modes;
    const double first = flow->angle, angle = first + flow->angular_frequency * u;
    const vi_complex start = vi_complex_multiply(flow->harmonic_force, (vi_complex){cos(first), sin(first)});
    const vi_complex end = vi_complex_multiply(flow->harmonic_force, (vi_complex){cos(angle), sin(angle)});
    vi_complex from[VI_TERMS], part[VI_TERMS];
    double sum = (flow->force_level + 0.5 * flow->force_rate * u) * u
                 + integral((vi_complex){0.0, flow->angular_frequency}, start, end, u);
    vi_pressed_flow_parts(flow, 0.0, from);
    vi_pressed_flow_parts(flow, u, part);
    for (int m = 0; m < modes->terms; ++m) {
        sum += modes->force[m] * integral(modes->rate[m], from[m], part[m], u);
    }
    return sum;
}

/* ---- what is seen ---- */

vi_pressed_sight vi_pressed_sight_of(const vi_pressed_flow *flow, int seen, double sign, double offset, double length)
{
    const vi_pressed *pressed = flow->pressed;
    const double *shape = seen == VI_SEEN_OBSERVED ? pressed->observed : seen < VI_PORTS ? pressed->shape[seen] : NULL;
    vi_pressed_sight sight = {.weight = pressed->weight[seen], .sign = sign, .offset = offset};
    if (shape == NULL) {
        sight.cosine = flow->harmonic_force.re;
        sight.sine = -flow->harmonic_force.im;
        sight.level = flow->force_level;
        sight.level_rate = flow->force_rate;
    }
    for (int j = 0; j < pressed->body.modes && shape != NULL; ++j) {
        sight.cosine += shape[j] * flow->harmonic[j].re;
        sight.sine -= shape[j] * flow->harmonic[j].im;
        sight.level += shape[j] * flow->level[j];
        sight.level_rate += shape[j] * flow->level_rate[j];
    }
    sight.scale = fabs(offset) + fabs(sight.cosine) + fabs(sight.sine) + fabs(sight.level)
                  + length * fabs(sight.level_rate);
    for (int m = 0; m < pressed->modes.terms; ++m) {
        sight.scale += vi_complex_size(vi_complex_multiply(sight.weight[m], flow->part[m]));
    }
    return sight;
}

/* The response, and the bound on its fourth derivative. */
static vi_part response_at(const vi_pressed_sight *sight, const vi_pressed_flow *flow, double u)
{
    const double w = flow->angular_frequency, angle = flow->angle + w * u, square = w * w;
    const double c = cos(angle), sn = sin(angle);
    const double x = sight->cosine * c + sight->sine * sn, v = w * (sight->sine * c - sight->cosine * sn);
    const double amplitude = sqrt(sight->cosine * sight->cosine + sight->sine * sight->sine);
    return (vi_part){x + (sight->level + sight->level_rate * u), v + sight->level_rate, -square * x, -square * v,
                     square * square * amplitude, 0.0};
}

/* One term, which only decays. */
static vi_part term_at(vi_complex weight, vi_complex part, vi_complex rate)
{
    const vi_complex x = vi_complex_multiply(weight, part), v = vi_complex_multiply(rate, x);
    const vi_complex a = vi_complex_multiply(rate, v), j = vi_complex_multiply(rate, a);
    const double reach = vi_complex_size(x), square = vi_complex_square(rate);
    return (vi_part){x.re, v.re, a.re, j.re, square * square * reach, reach};
}

vi_approach vi_pressed_approach(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[],
                                double u)
{
    const vi_pressed_modes *modes = &flow->pressed->modes;
    vi_part sum = response_at(sight, flow, u);
    for (int m = 0; m < modes->terms; ++m) {
        const vi_part term = term_at(sight->weight[m], part[m], modes->rate[m]);
        vi_part_add(&sum, 1.0, &term);
    }
    return vi_part_approach(&sum, sight->offset, sight->sign);
}

double vi_pressed_step(const vi_pressed_sight *sight, const vi_pressed_flow *flow, const vi_complex part[], double u,
                       double horizon)
{
    const vi_pressed_modes *modes = &flow->pressed->modes;
    vi_part sum[VI_TERMS + 1]; /* of the response and the slow terms */
    double ripple[VI_TERMS];
    sum[0] = response_at(sight, flow, u);
    for (int m = 0; m < modes->terms; ++m) {
        const vi_part term = term_at(sight->weight[m], part[m], modes->rate[m]);
        sum[m + 1] = sum[m];
        vi_part_add(&sum[m + 1], 1.0, &term);
        ripple[m] = term.reach;
    }
    return vi_rippling_step(sum, ripple, modes->terms, sight->offset, sight->sign, horizon);
}
