/* Joint impulses of the contacts that are hit, and chatter summed to its end. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "body/modal/structure_parts.h"
#include "contact/complementarity.h"
#include "motion/majorant.h"

/* Chatter is summed only far down a sequence, so that its impacts are seen one by one before. */
static const double TAIL_VELOCITY = 1e-4;
/* Largest error of the summed time, in units of 1 / fastest rate. */
static const double TAIL_ERROR = 1e-16;
/* A bounce lower than this times the resolution of displacements cannot be followed: the body rests. */
static const double LOWEST_BOUNCE = 8.0;
/* After so many low impacts in a row the body rests: only restitution (almost) 1 gets there. */
static const int64_t MOST_LOW_IMPACTS = 4000000;
/* Low: bounces not higher than this times the displacements, or this short in radians of the fastest rate. */
static const double LOW_HEIGHT = 1e-10, SHORT_FLIGHT = 1e-7;
/* A bounce shorter than this over the fastest rate is followed from the stop: of it only the position is rounded. */
static const double LOW_BOUNCE = 0.1;
/* A joint impact may set off others at the same instant; each round loses energy or ends, but between stops that leave
 * no room it would go on for ever. */
static const int MOST_ROUNDS = 64;

double vi_structure_kinetic(const vi_structure *s)
{
    return 0.5 * vi_structure_at(s->model, s->state->p, s->state->p);
}

static double restitution_of(const vi_structure *s, int k, double approach)
{
    const vi_contact *contact = &s->contacts[k];
    return contact->law.law == VI_LAW_EXTERNAL ? contact->applied_restitution
                                               : vi_contact_law_restitution(&contact->law, approach);
}

void vi_structure_look_at_held(const vi_structure *s, int k, vi_held_view *view)
{
    const vi_structure_model *model = s->model;
    vi_structure_state *state = s->state;
    double g[VI_PORTS][VI_PORTS], x[VI_PORTS] = {0.0}, unit[VI_PORTS], held[VI_MODES], at[VI_PORTS], sign[VI_PORTS];
    int active[VI_PORTS] = {0};
    vi_press press[VI_PORTS];
    for (int l = 0; l < model->contacts; ++l) {
        press[l] = vi_structure_press(s, l);
        at[l] = -vi_structure_clearance(s, l);
        sign[l] = vi_structure_direction(s, l);
        if (l == k) {
            press[l] = (vi_press){.kind = VI_PRESS_HOLD};
        } else if (press[l].kind == VI_PRESS_POWER && !(at[l] > 0.0)) {
            press[l] = (vi_press){.kind = VI_PRESS_NONE};
        }
        active[l] = press[l].kind == VI_PRESS_HOLD;
    }
    vi_structure_signed(s, s->model->compliance, g);
    x[k] = 1.0;
    vi_solve_active(model->contacts, g, x, active, unit); /* 1 / effective mobility = the diagonal of the inverse */
    view->mobility = unit[k] > 0.0 ? 1.0 / unit[k] : HUGE_VAL;
    x[k] = vi_structure_approach(s, k);
    vi_solve_active(model->contacts, g, x, active, unit);
    memcpy(view->p, state->p, sizeof view->p);
    for (int l = 0; l < model->contacts; ++l) {
        vi_structure_push(s, l, unit[l], view->p);
    }
    const vi_phase phase = vi_structure_phase(s);
    vi_structure_held_now(s, held);
    at[k] = 0.0;
    const vi_drift_start start = {state->q, view->p, phase.cosine, phase.sine, held, state->held_rate, at, sign, press};
    vi_drift drift;
    vi_drift_begin(&drift, model, &start, 1.0);
    view->pressure = drift.force[k][0] * view->mobility;
    view->slope = drift.force[k][1] * view->mobility;
    view->bend = 2.0 * drift.force[k][2] * view->mobility;
    view->noise = VI_ROUNDING * drift.force_scale[k] * view->mobility;
    view->free_noise = VI_ROUNDING * drift.force_scale[k] * fabs(model->mobility[k][k]);
    view->first = vi_structure_first_of_force(s, &drift, k);
    view->lead = view->first <= VI_ORDER ? drift.force[k][view->first] : 0.0;
}

/* The end of a chatter sequence: equations.md 3.1. */
typedef struct {
    double duration, error; /* s */
    bool complete;          /* the pressure lasts to the end */
} chatter_tail;

static double drag_at(const vi_structure *s, int k)
{
    const vi_structure_model *model = s->model;
    double drag = 0.0;
    for (int j = 0; j < model->modes; ++j) {
        const double pulled = model->coupled ? vi_structure_at(model, model->coupling[j], model->impulse[k])
                                             : 2.0 * model->mode[j].decay * model->impulse[k][j];
        drag += model->shape[k][j] * pulled;
    }
    return drag / model->mobility[k][k];
}

static chatter_tail sum_tail(const vi_structure *s, int k, const vi_held_view *view, double rebound, double restitution)
{
    const double t = 2.0 * rebound / (view->pressure * (1.0 - restitution)), drag = drag_at(s, k);
    const double relative = (fabs(view->slope) / view->pressure + drag) * t;
    const double bend = fabs(view->bend) * t * t / view->pressure, dragged = drag * t / 3.0;
    chatter_tail tail;
    /* second order in t; for r near 1, where t is long, drag turns it into ln(1 + g t/3)/(g/3) */
    tail.duration = (dragged > 0.0 ? t * (log1p(dragged) / dragged) : t) - t * t / 3.0 * (view->slope / view->pressure);
    tail.error = t * (relative * relative + bend);
    tail.complete = relative + bend < 0.25 && t * s->model->fastest < 0.5;
    return tail;
}

/* Size of displacements that double precision cannot tell apart at a contact, m. */
static double resolution(const vi_structure *s, int k, double pressure, double approach)
{
    const bool low = pressure > 0.0 && 2.0 * approach * s->model->fastest < LOW_BOUNCE * pressure;
    return DBL_EPSILON * (low ? fabs(s->contacts[k].position) : vi_structure_displacement_size(s, k));
}

/* The plastic impact that stands for the rest of a chatter sequence, or for a stop without rebound. */
static void come_to_rest(const vi_structure *s, int k, const vi_held_view *view, double delay, double tail_impulse)
{
    const double before = s->state->follow_energies ? vi_structure_kinetic(s) : 0.0;
    memcpy(s->state->p, view->p, sizeof view->p);
    s->state->energies.contact_loss += s->state->follow_energies ? before - vi_structure_kinetic(s) : 0.0;
    vi_structure_rest(s, k, delay, tail_impulse);
}

/* Rest on stop k now if the bounces still to come can be summed (or are too low, or too many, to be followed). */
static void rest_if_summable(const vi_structure *s, int k, double rebound, double restitution, bool tiny)
{
    vi_held_view view;
    vi_structure_look_at_held(s, k, &view);
    if (rebound == 0.0 && view.lead >= 0.0 && fabs(view.pressure) <= view.noise) {
        come_to_rest(s, k, &view, 0.0, 0.0); /* neither pressed nor lifted */
        return;
    }
    if (!(view.pressure > 0.0)) {
        return;
    }
    const double resolved = resolution(s, k, view.pressure, rebound);
    const bool lowest = rebound * rebound <= 2.0 * view.pressure * LOWEST_BOUNCE * resolved;
    const bool loses = restitution < 1.0 || drag_at(s, k) > 0.0;
    const bool endless = s->state->low_impacts[k] > MOST_LOW_IMPACTS && (loses || tiny);
    if (restitution < 1.0) {
        const chatter_tail tail = sum_tail(s, k, &view, rebound, restitution);
        const double precise = s->model->fastest > 0.0 ? TAIL_ERROR / s->model->fastest : HUGE_VAL;
        if (tail.complete && (lowest || endless || tail.error <= precise)) {
            const double impulse = (1.0 + restitution) * rebound / (view.mobility * (1.0 - restitution));
            come_to_rest(s, k, &view, vi_max(0.0, tail.duration), impulse);
            return;
        }
    }
    if (endless || (lowest && restitution == 1.0)) {
        come_to_rest(s, k, &view, 0.0, 0.0);
    }
}

static void count_impact(const vi_structure *s, int k, double approach, double impulse, double restitution)
{
    vi_contact *contact = &s->contacts[k];
    contact->count += 1;
    contact->last_time = vi_clock_time(&s->model->clock, s->state->now);
    contact->last_phase = vi_clock_phase(&s->model->clock, s->state->now);
    contact->last_velocity = approach;
    contact->impulse = impulse;
    vi_record_impact(s->record, contact->last_time, contact->last_phase, approach, impulse, k + 1, restitution);
}

/* Speed at which contact k leaves after the impulses: that of its law, or more where others have thrown it off. */
static double rebound_of(const vi_structure *s, int k, double approach, double impulse, double restitution)
{
    const double own = restitution * approach, speed = -vi_structure_approach(s, k);
    const bool thrown = !(impulse > 0.0) && speed > own + VI_ROUNDING * vi_structure_velocity_size(s, k);
    return thrown ? speed : own;
}

/* One contact after the impulses: count it, and let it rest where its chatter can be summed. */
static void after_impact(const vi_structure *s, int k, double approach, double impulse, double restitution)
{
    vi_structure_state *state = s->state;
    const double rebound = rebound_of(s, k, approach, impulse, restitution);
    double acceleration[VI_MODES], force[VI_PORTS];
    vi_structure_accelerate(s, acceleration, force);
    const double a = vi_structure_direction(s, k) * vi_structure_at(s->model, s->model->shape[k], acceleration);
    const double resolved = resolution(s, k, a, approach);
    /* below this speed a touch cannot be told from a miss: it stands for less penetration than can be resolved */
    const bool graze = approach * approach <= 2.0 * fabs(a) * resolved;
    state->budget.events += 1;
    if (graze) {
        s->contacts[k].graze_count += 1;
    } else {
        count_impact(s, k, approach, impulse, restitution);
    }
    const double height = LOW_HEIGHT * vi_structure_displacement_size(s, k);
    const bool tiny = a > 0.0 && (rebound * rebound <= 2.0 * a * height
                                  || 2.0 * rebound * s->model->fastest <= SHORT_FLIGHT * a);
    state->fastest_impact[k] = vi_max(state->fastest_impact[k], approach);
    const bool far_down = rebound <= TAIL_VELOCITY * state->fastest_impact[k] || graze;
    state->low_impacts[k] = far_down || tiny ? state->low_impacts[k] + 1 : 0;
    state->status[k] = VI_CONTACT_TOUCHING;
    state->leaving[k] = rebound == 0.0 ? 1 : 0;
    if (far_down || state->low_impacts[k] > MOST_LOW_IMPACTS) {
        rest_if_summable(s, k, rebound, restitution, tiny);
    }
}

/* To the modes, rounded once: what is less than a rounding of the impulse still decides how a velocity is rounded. */
static void give_impulses(const vi_structure *s, const double impulse[], const double low[])
{
    for (int k = 0; k < s->model->contacts; ++k) {
        const double sign = vi_structure_direction(s, k), push = -sign * impulse[k], push_low = -sign * low[k];
        for (int j = 0; j < s->model->modes && push != 0.0; ++j) {
            const double gain = s->model->impulse[k][j], step = gain * push, before = s->state->p[j];
            const double sum = before + step, part = sum - before;
            const double rounding = (before - (sum - part)) + (step - part);
            s->state->p[j] = sum + (rounding + (fma(gain, push, -step) + gain * push_low));
        }
    }
}

/* What rounding has taken from the impulses p > 0 of g p = b, g given to twice its digits. */
static void refine(int n, double g[VI_PORTS][VI_PORTS], double low[VI_PORTS][VI_PORTS], const double b[],
                   const double p[], double more[])
{
    double left[VI_PORTS];
    int active[VI_PORTS] = {0};
    for (int i = 0; i < n; ++i) {
        double sum = b[i], rounding = 0.0;
        active[i] = p[i] > 0.0;
        for (int j = 0; j < n; ++j) {
            const double product = -g[i][j] * p[j], total = sum + product, part = total - sum;
            rounding += fma(-g[i][j], p[j], -product) + ((sum - (total - part)) + (product - part)) - low[i][j] * p[j];
            sum = total;
        }
        left[i] = sum + rounding;
    }
    vi_solve_active(n, g, left, active, more);
}

/* Solve for the impulses of the contacts in play; the others are out of the problem. */
static void joint_impulses(const vi_structure *s, const int in_play[], const double wanted[], double impulse[],
                           double impulse_low[])
{
    double whole[VI_PORTS][VI_PORTS], whole_low[VI_PORTS][VI_PORTS], g[VI_PORTS][VI_PORTS], low[VI_PORTS][VI_PORTS];
    double b[VI_PORTS], p[VI_PORTS], more[VI_PORTS];
    int index[VI_PORTS], count = 0;
    vi_structure_signed(s, s->model->mobility, whole);
    vi_structure_signed(s, s->model->mobility_low, whole_low);
    for (int k = 0; k < s->model->contacts; ++k) {
        impulse[k] = impulse_low[k] = 0.0;
        if (in_play[k]) {
            index[count++] = k;
        }
    }
    for (int i = 0; i < count; ++i) {
        b[i] = wanted[index[i]];
        for (int j = 0; j < count; ++j) {
            g[i][j] = whole[index[i]][index[j]];
            low[i][j] = whole_low[index[i]][index[j]];
        }
    }
    vi_complementary(count, g, b, p);
    refine(count, g, low, b, p, more);
    for (int i = 0; i < count; ++i) {
        impulse[index[i]] = p[i];
        impulse_low[index[i]] = more[i];
    }
}

/* One round: every contact that is hit asks for its rebound; those at rest on a stop only may not be pushed in. */
static void collide_once(const vi_structure *s, const int hit[VI_PORTS])
{
    vi_structure_state *state = s->state;
    const int n = s->model->contacts;
    double approach[VI_PORTS] = {0.0}, restitution[VI_PORTS] = {0.0}, wanted[VI_PORTS] = {0.0};
    double impulse[VI_PORTS], impulse_low[VI_PORTS];
    int in_play[VI_PORTS] = {0};
    const double before = vi_structure_kinetic(s);
    for (int k = 0; k < n; ++k) {
        const bool resting = state->status[k] == VI_CONTACT_HELD
                             || (state->status[k] == VI_CONTACT_TOUCHING && state->leaving[k]);
        in_play[k] = hit[k] || resting;
        if (hit[k]) {
            approach[k] = vi_max(0.0, vi_structure_approach(s, k));
            restitution[k] = restitution_of(s, k, approach[k]);
            wanted[k] = (1.0 + restitution[k]) * approach[k];
        }
    }
    joint_impulses(s, in_play, wanted, impulse, impulse_low);
    give_impulses(s, impulse, impulse_low);
    state->energies.contact_loss += state->follow_energies ? before - vi_structure_kinetic(s) : 0.0;
    for (int k = 0; k < n; ++k) {
        if (in_play[k] && !hit[k] && state->leaving[k] > 1) {
            state->leaving[k] = 1; /* its acceleration may be another now */
        }
        if (in_play[k] && !hit[k] && !(impulse[k] > 0.0)
            && vi_structure_approach(s, k) < -VI_ROUNDING * vi_structure_velocity_size(s, k)) {
            if (state->status[k] == VI_CONTACT_HELD) {
                vi_structure_release(s, k, 0);
            }
            state->leaving[k] = 0;
        }
    }
    for (int k = 0; k < n; ++k) {
        if (hit[k]) {
            after_impact(s, k, approach[k], impulse[k], restitution[k]);
        }
    }
}

/* A body between stops that leave it no room: whatever touches comes to rest. */
static void wedge(const vi_structure *s)
{
    double g[VI_PORTS][VI_PORTS], approach[VI_PORTS], impulse[VI_PORTS];
    int touches[VI_PORTS] = {0};
    const double before = vi_structure_kinetic(s);
    for (int k = 0; k < s->model->contacts; ++k) {
        const int32_t status = s->state->status[k];
        touches[k] = status == VI_CONTACT_TOUCHING || status == VI_CONTACT_HELD;
        approach[k] = vi_structure_approach(s, k);
    }
    vi_structure_signed(s, s->model->compliance, g);
    vi_solve_active(s->model->contacts, g, approach, touches, impulse);
    for (int k = 0; k < s->model->contacts; ++k) {
        vi_structure_push(s, k, impulse[k], s->state->p);
    }
    s->state->energies.contact_loss += s->state->follow_energies ? before - vi_structure_kinetic(s) : 0.0;
}

void vi_structure_collide(const vi_structure *s, const int hit[VI_PORTS])
{
    int now[VI_PORTS];
    memcpy(now, hit, sizeof now);
    for (int round = 0; round < MOST_ROUNDS; ++round) {
        collide_once(s, now);
        int any = 0;
        for (int k = 0; k < s->model->contacts; ++k) {
            const bool rigid = s->contacts[k].law.law == VI_LAW_RESTITUTION;
            if (rigid && vi_structure_meets_now(s, k)) { /* thrown against it by the last round, in a corner */
                s->state->status[k] = VI_CONTACT_TOUCHING;
                s->state->leaving[k] = 0;
            }
            const bool touches = s->state->status[k] == VI_CONTACT_TOUCHING && !s->state->leaving[k] && rigid;
            now[k] = touches && vi_structure_approach(s, k) > VI_ROUNDING * vi_structure_velocity_size(s, k);
            any |= now[k];
        }
        if (!any) {
            return;
        }
    }
    wedge(s);
}
