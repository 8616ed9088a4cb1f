#include "body/modal/pressed_flow.h"

#include <math.h>
#include <string.h>

#include "body/modal/forces.h"
#include "modes/pressed_response.h"
#include "motion/ripple.h"

/* Largest response, relative to the motion; a larger one would cost the motion more than this many roundings. */
static const double LARGEST_RESPONSE = 64.0;
/* Radians of a term below which its integral is a series, since the difference of its end values would be rounding. */
static const double SHORT = 0.5;
enum { SERIES = 14 };

/* Response to loads of the form Re(load e^(s t)); s is 0 or that of the forcing. */
static void answer(const vi_pressed *pressed, vi_complex s, const vi_complex load[], const vi_complex offset[],
                   vi_complex q[], vi_complex force[])
{
    if (pressed->known == VI_MODES_OF_ONE) {
        vi_pressed_response(&pressed->body, s, load, offset[0], q, force);
    } else {
        vi_coupled_response(s.im == 0.0 ? &pressed->still : &pressed->harmonic, &pressed->body, load, offset, q, force);
    }
}

static void respond_to_forcing(vi_pressed_flow *flow, const vi_structure *s)
{
    const vi_complex none[VI_PORTS] = {{0.0, 0.0}};
    vi_complex load[VI_MODES];
    for (int j = 0; j < flow->pressed->body.modes; ++j) {
        load[j] = (vi_complex){s->model->mode[j].force, 0.0};
    }
    answer(flow->pressed, (vi_complex){0.0, flow->angular_frequency}, load, none, flow->harmonic, flow->harmonic_force);
}

/* Response to the present loads, with their slopes. */
static void respond_to_loads(vi_pressed_flow *flow, const vi_structure *s, const double held[])
{
    const vi_pressed *pressed = flow->pressed;
    const vi_pressed_body *body = &pressed->body;
    const vi_complex still = {0.0, 0.0};
    vi_complex load[VI_MODES], found[VI_MODES], force[VI_PORTS], offset[VI_PORTS] = {{0.0, 0.0}};
    for (int j = 0; j < body->modes; ++j) {
        load[j] = (vi_complex){s->state->held_rate[j], 0.0};
    }
    answer(pressed, still, load, offset, found, force);
    for (int j = 0; j < body->modes; ++j) {
        flow->level_rate[j] = found[j].re;
    }
    for (int i = 0; i < body->contacts; ++i) {
        const int k = pressed->port[i];
        double rate = 0.0;
        for (int j = 0; j < body->modes; ++j) {
            rate += body->shape[i][j] * flow->level_rate[j];
        }
        const double behind = body->held[i] ? 0.0 : body->damping[i] * rate / body->stiffness[i];
        offset[i].re = vi_structure_direction(s, k) * s->contacts[k].position - behind;
        flow->force_rate[i] = force[i].re;
    }
    for (int j = 0; j < body->modes; ++j) {
        load[j] = (vi_complex){held[j] - vi_pressed_drag(body, j, flow->level_rate), 0.0};
    }
    answer(pressed, still, load, offset, found, force);
    for (int j = 0; j < body->modes; ++j) {
        flow->level[j] = found[j].re;
    }
    for (int i = 0; i < body->contacts; ++i) {
        flow->force_level[i] = force[i].re;
    }
}

/* Whether the response is small enough that displacements and velocities keep their digits when it is added. */
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

bool vi_pressed_flow_start(vi_pressed_flow *flow, const vi_structure *s, const vi_pressed *pressed, double length)
{
    const vi_phase phase = vi_structure_phase(s);
    const double w = s->model->clock.angular_frequency;
    double held[VI_MODES] = {0.0}, q[VI_MODES] = {0.0}, p[VI_MODES] = {0.0};
    flow->pressed = pressed;
    flow->angle = phase.angle;
    flow->angular_frequency = w;
    flow->since = flow->since_low = 0.0;
    vi_structure_held_now(s, held);
    respond_to_forcing(flow, s);
    respond_to_loads(flow, s, held);
    for (int j = 0; j < pressed->body.modes; ++j) {
        const vi_complex harmonic = flow->harmonic[j];
        const double x = harmonic.re * phase.cosine - harmonic.im * phase.sine;
        const double v = -w * (harmonic.re * phase.sine + harmonic.im * phase.cosine);
        q[j] = s->state->q[j] - flow->level[j] - x;
        p[j] = s->state->p[j] - flow->level_rate[j] - v;
    }
    vi_pressed_parts(&pressed->modes, q, p, flow->part);
    return keeps_digits(flow, s, length);
}

/* Are the contacts' status and the stops unchanged since the origin of the rest? */
static bool same_stops(const vi_structure *s)
{
    const vi_rest_origin *origin = &s->state->rest;
    for (int k = 0; k < s->model->contacts; ++k) {
        const vi_contact *contact = &s->contacts[k];
        if (origin->status[k] != s->state->status[k]
            || (origin->status[k] != VI_CONTACT_FREE
                && (origin->position[k] != contact->position || origin->stiffness[k] != contact->law.stiffness
                    || origin->damping[k] != contact->law.damping))) {
            return false;
        }
    }
    return true;
}

bool vi_pressed_goes_on(const vi_structure *s)
{
    const vi_rest_origin *origin = &s->state->rest;
    double held[VI_MODES];
    if (!origin->known || s->model->varies || !same_stops(s)) {
        return false;
    }
    vi_structure_held_now(s, held);
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        if (s->state->q[j] != origin->reached_q[j] || s->state->p[j] != origin->reached_p[j]
            || held[j] != origin->held[j] || s->state->held_rate[j] != 0.0) {
            return false;
        }
    }
    return true;
}

void vi_pressed_flow_follow(vi_pressed_flow *flow, const vi_structure *s)
{
    vi_rest_origin *origin = &s->state->rest;
    if (vi_pressed_goes_on(s)) {
        memcpy(flow->part, origin->part, sizeof flow->part);
        flow->since = vi_clock_elapsed_twofold(&s->model->clock, origin->at, s->state->now, &flow->since_low);
        return;
    }
    memset(origin, 0, sizeof *origin);
    origin->known = 1;
    origin->at = s->state->now;
    memcpy(origin->part, flow->part, (size_t)flow->pressed->modes.terms * sizeof flow->part[0]);
    vi_structure_held_now(s, origin->held);
    for (int k = 0; k < s->model->contacts; ++k) {
        origin->status[k] = s->state->status[k];
        if (origin->status[k] != VI_CONTACT_FREE) {
            origin->position[k] = s->contacts[k].position;
            origin->stiffness[k] = s->contacts[k].law.stiffness;
            origin->damping[k] = s->contacts[k].law.damping;
        }
    }
}

void vi_pressed_flow_reach(const vi_structure *s)
{
    const size_t size = (size_t)vi_structure_modes(s->model) * sizeof(double);
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

vi_complex vi_term_integral(vi_complex rate, vi_complex start, vi_complex end, double u)
{
    if (vi_complex_size(rate) * u > SHORT) {
        return vi_complex_divide(vi_complex_subtract(end, start), rate);
    }
    vi_complex term = vi_complex_scale(u, start), sum = term;
    for (int n = 2; n < SERIES; ++n) {
        term = vi_complex_scale(u / (double)n, vi_complex_multiply(rate, term));
        sum = vi_complex_add(sum, term);
    }
    return sum;
}

vi_complex vi_product_integral(vi_complex rate, vi_complex start, vi_complex end, vi_complex other_rate,
                               vi_complex other_start, vi_complex other_end, double u)
{
    return vi_term_integral(vi_complex_add(rate, other_rate), vi_complex_multiply(start, other_start),
                            vi_complex_multiply(end, other_end), u);
}

double vi_pressed_flow_impulse(const vi_pressed_flow *flow, int i, double u)
{
    const vi_pressed_modes *modes = &flow->pressed->modes;
    const double first = flow->angle, angle = first + flow->angular_frequency * u;
    const vi_complex start = vi_complex_multiply(flow->harmonic_force[i], (vi_complex){cos(first), sin(first)});
    const vi_complex end = vi_complex_multiply(flow->harmonic_force[i], (vi_complex){cos(angle), sin(angle)});
    vi_complex from[VI_TERMS], part[VI_TERMS];
    double sum = (flow->force_level[i] + 0.5 * flow->force_rate[i] * u) * u
                 + vi_term_integral((vi_complex){0.0, flow->angular_frequency}, start, end, u).re;
    vi_pressed_flow_parts(flow, 0.0, from);
    vi_pressed_flow_parts(flow, u, part);
    for (int m = 0; m < modes->terms; ++m) {
        const vi_complex force = modes->force[m][i];
        sum += vi_term_integral(modes->rate[m], vi_complex_multiply(force, from[m]), vi_complex_multiply(force, part[m]),
                                u).re;
    }
    return sum;
}

/* ---- observed quantities ---- */

vi_pressed_sight vi_pressed_sight_of(const vi_pressed_flow *flow, int seen, double sign, double offset, double length)
{
    const vi_pressed *pressed = flow->pressed;
    const double *shape = seen == VI_SEEN_OBSERVED ? pressed->observed : seen < VI_PORTS ? pressed->shape[seen] : NULL;
    vi_pressed_sight sight = {.weight = pressed->weight[seen], .sign = sign, .offset = offset};
    if (shape == NULL) {
        const int i = seen - VI_SEEN_FORCE;
        sight.cosine = flow->harmonic_force[i].re;
        sight.sine = -flow->harmonic_force[i].im;
        sight.level = flow->force_level[i];
        sight.level_rate = flow->force_rate[i];
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

/* The response of an observed quantity, with the bound on its fourth derivative. */
static vi_part response_at(const vi_pressed_sight *sight, const vi_pressed_flow *flow, double u)
{
    const double w = flow->angular_frequency, angle = flow->angle + w * u, square = w * w;
    const double c = cos(angle), sn = sin(angle);
    const double x = sight->cosine * c + sight->sine * sn, v = w * (sight->sine * c - sight->cosine * sn);
    const double amplitude = sqrt(sight->cosine * sight->cosine + sight->sine * sight->sine);
    return (vi_part){x + (sight->level + sight->level_rate * u), v + sight->level_rate, -square * x, -square * v,
                     square * square * amplitude, 0.0};
}

/* One term of an observed quantity; it only decays. */
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
    vi_part sum[VI_TERMS + 1], so_far = response_at(sight, flow, u); /* with the slow terms */
    double ripple[VI_TERMS];
    vi_part_keep(&sum[0], &so_far);
    for (int m = 0; m < modes->terms; ++m) {
        const vi_part term = term_at(sight->weight[m], part[m], modes->rate[m]);
        vi_part_add(&so_far, 1.0, &term);
        vi_part_keep(&sum[m + 1], &so_far);
        ripple[m] = term.reach;
    }
    return vi_rippling_step(sum, ripple, modes->terms, sight->offset, sight->sign, horizon);
}
