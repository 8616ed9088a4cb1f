#include "body/modal/structure/pressed.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/pressed_energies.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/extremes.h"
#include "motion/majorant.h"

/* Segments by series after which a rest counts as long, for stops that yield and for held contacts. Most contacts with
 * stops that yield end earlier. */
enum { PATIENCE = 16, PATIENCE_HELD = 4 };
/* Least certified step, in radians of the fastest rate, that repays an evaluation of all terms. A radian by series costs
 * as much with 64 modes. LEAST_REST: least length of a rest; times the number of modes where the modes must be found
 * anew. */
static const double LEAST_STEP = 2.0, LEAST_REST = 32.0;
/* Least length of a rest, in radians times modes^2, for modes of several contacts or of coupled damping. */
static const double ALL_MODES = 2.0;
/* Distance from zero, in roundings of the terms, below which a guarded quantity is left to the series. */
static const double MARGIN = 16.0;

/* ---- is this a long rest? ---- */

/* Upper bound of the rates of the resting body's motions, rad/s. */
static double fastest_rate(const vi_structure *s, const int32_t port[], int contacts)
{
    double stiffness = 0.0, damping = 0.0;
    for (int i = 0; i < contacts; ++i) {
        const int k = port[i];
        const vi_press press = vi_structure_press(s, k);
        stiffness += press.stiffness * s->model->compliance[k][k];
        damping += press.damping * s->model->compliance[k][k];
    }
    return s->model->fastest + sqrt(stiffness) + damping;
}

static int64_t patience(const vi_structure *s)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->state->status[k] == VI_CONTACT_YIELDING) {
            return PATIENCE;
        }
    }
    return PATIENCE_HELD;
}

/* Length of a rest, in radians of the fastest rate, from which finding its modes pays. */
static double pays(const vi_structure *s)
{
    return s->model->varies ? LEAST_REST * (double)vi_structure_modes(s->model) : LEAST_REST;
}

/* Does finding modes of several contacts, or of coupled damping, pay too? Segments by series count as radians. */
static bool pays_for_all(const vi_structure *s, double radians)
{
    const double modes = (double)vi_structure_modes(s->model), spent = s->model->varies ? 0.0 : (double)s->state->series;
    return radians + spent >= ALL_MODES * modes * modes || vi_pressed_goes_on(s);
}

/* ---- certified time without events ---- */

typedef struct {
    int count;
    vi_pressed_sight sight[VI_PORTS]; /* forces of the pressed contacts, clearances of the others */
} guard;

static void start_guard(const vi_structure *s, const vi_pressed_flow *flow, double length, guard *g)
{
    const double rounding = MARGIN * VI_ROUNDING;
    g->count = 0;
    for (int i = 0; i < flow->pressed->body.contacts; ++i) {
        vi_pressed_sight *sight = &g->sight[g->count++];
        *sight = vi_pressed_sight_of(flow, VI_SEEN_FORCE + i, -1.0, 0.0, length);
        sight->offset = -rounding * sight->scale;
    }
    for (int l = 0; l < s->model->contacts; ++l) {
        if (s->state->status[l] == VI_CONTACT_FREE && vi_structure_watched(s, l)) {
            vi_pressed_sight *sight = &g->sight[g->count++];
            const double sign = vi_structure_direction(s, l);
            *sight = vi_pressed_sight_of(flow, l, sign, sign * s->contacts[l].position, length);
            sight->offset -= rounding * (sight->scale + vi_structure_displacement_size(s, l));
        }
    }
}

/* Time in which the contact surely stays pressed and no other begins, at most the length. Steps < `least` end it. */
static double certain(const vi_structure *s, const vi_pressed_flow *flow, const guard *g, double length, double least)
{
    vi_complex part[VI_TERMS];
    double u = 0.0;
    for (int evaluation = 0; evaluation < VI_MOST_EVALUATIONS; ++evaluation) {
        double step = length - u;
        vi_budget_spend(&s->state->budget, flow->pressed->modes.terms);
        vi_pressed_flow_parts(flow, u, part);
        for (int i = 0; i < g->count; ++i) {
            const vi_approach p = vi_pressed_approach(&g->sight[i], flow, part, u);
            if (!(p.clearance > 0.0) || !isfinite(p.bound)) {
                return u;
            }
            step = vi_min(step, vi_pressed_step(&g->sight[i], flow, part, u, step));
        }
        if (!(step < length - u)) {
            return length;
        }
        if (step < least) {
            return u;
        }
        u += step;
    }
    return u;
}

/* ---- extremes of the observed point ---- */

/* The largest displacement * sign so far, of the record and of the present state. */
static double largest_so_far(const vi_structure *s, double sign)
{
    const double here = vi_structure_at(s->model, s->model->observed, s->state->q);
    return vi_max(sign * here, sign > 0.0 ? s->record->displacement_max : -s->record->displacement_min);
}

/* The same of a further observed point. */
static double largest_of_point(const vi_structure *s, int point, double sign)
{
    const vi_record_point *p = &s->record->point[point];
    const double here = vi_structure_at(s->model, s->model->shape[s->model->contacts + point], s->state->q);
    return vi_max(sign * here, sign > 0.0 ? p->displacement_max : -p->displacement_min);
}

/* Rounding of the observed point's velocity. */
static double speed_noise(const vi_pressed_sight *sight, double speed, double fastest)
{
    return VI_ROUNDING * (fabs(speed) + sight->scale * fastest);
}

/* Climb from u to the next turning point above the bar; raises the bar to this value. */
static double climb(const vi_structure *s, const vi_pressed_flow *flow, vi_pressed_sight *sight, double fastest,
                    double u, double end)
{
    vi_complex part[VI_TERMS];
    for (int evaluation = 0;; ++evaluation) {
        vi_budget_spend(&s->state->budget, flow->pressed->modes.terms);
        vi_pressed_flow_parts(flow, u, part);
        const vi_approach p = vi_pressed_approach(sight, flow, part, u);
        if (!(p.velocity > speed_noise(sight, p.velocity, fastest)) || u >= end) {
            sight->offset += vi_max(0.0, -p.clearance);
            return u;
        }
        /* search the velocity's fall to zero like a clearance's */
        const vi_approach fall = {p.velocity, -p.acceleration, -p.jerk, p.bound, 0.0};
        u = vi_min(end, u + vi_max(vi_certified_step(&fall, end - u), vi_least_step(end, 1e-12, evaluation)));
    }
}

/* Raise the bar of a sight to the largest value over the rest; times with values below the bar are skipped. */
static void raise_bar(const vi_structure *s, const vi_pressed_flow *flow, vi_pressed_sight *sight, double fastest,
                      double end)
{
    const double least = VI_ROUNDING * sight->scale;
    vi_complex part[VI_TERMS];
    double u = 0.0;
    for (int evaluation = 0; u < end; ++evaluation) {
        const double least_step = vi_least_step(end, 1e-9, evaluation);
        vi_budget_spend(&s->state->budget, flow->pressed->modes.terms);
        vi_pressed_flow_parts(flow, u, part);
        const vi_approach p = vi_pressed_approach(sight, flow, part, u);
        if (p.clearance <= least && p.velocity > speed_noise(sight, p.velocity, fastest)) {
            u = climb(s, flow, sight, fastest, u, end) + least_step;
            continue;
        }
        const double room = least + vi_max(0.0, -p.clearance);
        sight->offset += room;
        u += vi_max(vi_pressed_step(sight, flow, part, u, end - u), least_step);
        sight->offset -= room;
    }
}

/* Largest displacement * sign over the rest. */
static void extreme(const vi_structure *s, const vi_pressed_flow *flow, double sign, double fastest, double end)
{
    vi_pressed_sight sight = vi_pressed_sight_of(flow, VI_SEEN_OBSERVED, sign, largest_so_far(s, sign), end);
    raise_bar(s, flow, &sight, fastest, end);
    vi_record_extend(s->record, vi_structure_within(s, sign * sight.offset));
}

/* The same of a further observed point. */
static void extreme_of_point(const vi_structure *s, const vi_pressed_flow *flow, int point, double sign, double fastest,
                             double end)
{
    const int seen = s->model->contacts + point;
    vi_pressed_sight sight = vi_pressed_sight_of(flow, seen, sign, largest_of_point(s, point, sign), end);
    raise_bar(s, flow, &sight, fastest, end);
    vi_record_point_extend(s->record, point, sign * sight.offset);
}

/* Update the largest force of the i-th pressed contact over the rest. */
static void peak(const vi_structure *s, const vi_pressed_flow *flow, int i, double fastest, double end)
{
    vi_touch_down *touch = &s->state->touch_down[flow->pressed->port[i]];
    vi_pressed_sight sight = vi_pressed_sight_of(flow, VI_SEEN_FORCE + i, 1.0, touch->peak, end);
    raise_bar(s, flow, &sight, fastest, end);
    touch->peak = sight.offset;
}

/* ---- a rest ---- */

/* Is the observed point itself held? */
static bool sees_only_the_stop(const vi_structure *s)
{
    const size_t size = (size_t)vi_structure_modes(s->model) * sizeof(double);
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->state->status[k] == VI_CONTACT_HELD && memcmp(s->model->observed, s->model->shape[k], size) == 0) {
            return true;
        }
    }
    return false;
}

static void rest(const vi_structure *s, const vi_pressed_flow *flow, double fastest, double u)
{
    vi_structure_state *state = s->state;
    vi_budget_spend(&state->budget, (int64_t)flow->pressed->modes.terms * vi_structure_modes(s->model) / 4);
    if (s->record->extrema && !sees_only_the_stop(s)) {
        extreme(s, flow, 1.0, fastest, u);
        extreme(s, flow, -1.0, fastest, u);
    }
    for (int point = 0; point < s->model->further && s->record->extrema; ++point) {
        extreme_of_point(s, flow, point, 1.0, fastest, u);
        extreme_of_point(s, flow, point, -1.0, fastest, u);
    }
    for (int i = 0; i < flow->pressed->body.contacts; ++i) {
        const int k = flow->pressed->port[i];
        if (state->status[k] == VI_CONTACT_YIELDING) {
            state->touch_down[k].impulse += vi_pressed_flow_impulse(flow, i, u);
        }
        if (vi_structure_follows_peak(s, k)) {
            peak(s, flow, i, fastest, u);
        }
    }
    double before[VI_MODES];
    memcpy(before, state->q, sizeof before);
    vi_pressed_flow_end(flow, u, state->q, state->p);
    vi_structure_project(s);
    if (state->follow_energies) {
        vi_energies_of_rest(s, flow, before, u);
    }
    vi_pressed_flow_reach(s);
    if (s->record->extrema) {
        vi_extremes_here(s);
    }
}

/* Follow a rest that is long enough for its modes. */
static double rest_for_long(const vi_structure *s, const vi_pressed *pressed, double fastest, double length, double room)
{
    vi_pressed_flow flow;
    guard g;
    double u = 0.0;
    if (vi_pressed_flow_start(&flow, s, pressed, length)) {
        vi_pressed_flow_follow(&flow, s);
        start_guard(s, &flow, length, &g);
        u = certain(s, &flow, &g, length + room, LEAST_STEP / fastest);
        u = u >= length + room ? length : u < length ? u : 0.0;
    }
    if (u < length) {
        s->state->series = 0; /* an event is near */
    }
    if (u > 0.0) {
        rest(s, &flow, fastest, u);
    }
    return u;
}

double vi_structure_rest_on(const vi_structure *s, double length, double room)
{
    int32_t port[VI_PORTS];
    if (s->pressed == NULL || !vi_structure_is_plain(s) || vi_structure_stops_move(s->model)
        || vi_structure_grows(s->model) || s->state->series < PATIENCE_HELD || !vi_structure_moves(s)) {
        return 0.0;
    }
    const int contacts = vi_pressed_contacts(s, port);
    if (contacts == 0 || s->state->series < patience(s)) {
        return 0.0;
    }
    const double fastest = fastest_rate(s, port, contacts);
    if (!(length * fastest >= pays(s))) {
        return 0.0;
    }
    const vi_pressed *pressed = vi_pressed_find(s, pays_for_all(s, length * fastest));
    return pressed != NULL ? rest_for_long(s, pressed, fastest, length, room) : 0.0;
}
