/* The moments of a contact: joint impulses, chatter summed to its end, rest, release, and compliant stops. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "complementarity.h"
#include "majorant.h"
#include "structure_parts.h"

/* Contacts whose clearance is below this many roundings of their displacement meet at the same instant. */
static const double SAME_INSTANT = 16.0;
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
/* A contact whose force ends at a penetration of so many roundings, or of a power law with 1 + damping d' above so
 * little, ends with its penetration. */
static const double WITH_IT = 64.0, GONE = 1e-9;
/* Of its own mobility, what is left to a contact whose point others hold. */
static const double KEPT = 1e-9;
/* A joint impact may set off others at the same instant; each round loses energy or ends, but between stops that leave
 * no room it would go on for ever. */
static const int MOST_ROUNDS = 64;

/* ---- forces now ---- */

vi_press vi_structure_press(const vi_structure *s, int k)
{
    const vi_contact *contact = &s->contacts[k];
    const vi_structure_state *state = s->state;
    if (state->status[k] == VI_CONTACT_HELD) {
        return (vi_press){.kind = VI_PRESS_HOLD};
    }
    if (state->status[k] != VI_CONTACT_YIELDING) {
        return (vi_press){.kind = VI_PRESS_NONE};
    }
    switch (contact->law.law) {
    case VI_LAW_KELVIN_VOIGT:
        return (vi_press){VI_PRESS_LINEAR, 0.0, contact->law.stiffness, contact->law.damping, 1.0};
    case VI_LAW_HERTZ: return (vi_press){VI_PRESS_POWER, 0.0, contact->law.stiffness, 0.0, 1.5};
    case VI_LAW_HUNT_CROSSLEY:
        return (vi_press){VI_PRESS_POWER, 0.0, contact->law.stiffness, contact->law.damping, contact->law.exponent};
    default: break;
    }
    const double constant = contact->applied_force - contact->applied_stiffness * state->reference_penetration[k]
                            - contact->applied_damping * state->reference_rate[k];
    return (vi_press){VI_PRESS_LINEAR, constant, contact->applied_stiffness, contact->applied_damping, 1.0};
}

/* Force of a yielding contact now, N. */
static double yield_force(const vi_structure *s, int k)
{
    const vi_press press = vi_structure_press(s, k);
    const double d = -vi_structure_clearance(s, k), rate = vi_structure_approach(s, k);
    if (press.kind == VI_PRESS_LINEAR) {
        return vi_max(0.0, press.constant + press.stiffness * d + press.damping * rate);
    }
    return press.kind == VI_PRESS_POWER ? vi_contact_law_force(&s->contacts[k].law, d, rate).force : 0.0;
}

static void add_push(const vi_structure *s, int k, double force, double acceleration[])
{
    const double push = vi_structure_direction(s, k) * force;
    for (int j = 0; j < s->model->modes && push != 0.0; ++j) {
        acceleration[j] -= s->model->shape[k][j] * push;
    }
}

/* Modal accelerations without held contacts. */
static void accelerate_freely(const vi_structure *s, double acceleration[], double force[])
{
    const vi_structure_model *model = s->model;
    const vi_structure_state *state = s->state;
    const double cosine = vi_structure_phase(s).cosine;
    vi_structure_held_now(s, acceleration);
    for (int j = 0; j < model->modes; ++j) {
        const vi_mode *mode = &model->mode[j];
        acceleration[j] += mode->force * cosine - mode->stiffness * state->q[j];
        acceleration[j] -= model->coupled ? vi_structure_at(model, model->coupling[j], state->p)
                                          : 2.0 * mode->decay * state->p[j];
    }
    for (int k = 0; k < model->contacts; ++k) {
        force[k] = state->status[k] == VI_CONTACT_YIELDING ? yield_force(s, k) : 0.0;
        add_push(s, k, force[k], acceleration);
    }
}

static void signed_matrix(const vi_structure *s, double matrix[VI_PORTS][VI_PORTS], double g[VI_PORTS][VI_PORTS])
{
    for (int k = 0; k < s->model->contacts; ++k) {
        for (int l = 0; l < s->model->contacts; ++l) {
            g[k][l] = vi_structure_direction(s, k) * vi_structure_direction(s, l) * matrix[k][l];
        }
    }
}

void vi_structure_accelerate(const vi_structure *s, double acceleration[], double force[])
{
    const vi_structure_model *model = s->model;
    double g[VI_PORTS][VI_PORTS], b[VI_PORTS] = {0.0}, hold[VI_PORTS];
    int held[VI_PORTS] = {0}, any = 0;
    accelerate_freely(s, acceleration, force);
    for (int k = 0; k < model->contacts; ++k) {
        held[k] = s->state->status[k] == VI_CONTACT_HELD;
        any |= held[k];
        b[k] = vi_structure_direction(s, k) * vi_structure_at(model, model->shape[k], acceleration);
    }
    if (!any) {
        return;
    }
    signed_matrix(s, s->model->compliance, g);
    vi_solve_active(model->contacts, g, b, held, hold);
    for (int k = 0; k < model->contacts; ++k) {
        if (held[k]) {
            force[k] = hold[k];
            add_push(s, k, hold[k], acceleration);
        }
    }
}

void vi_structure_project(const vi_structure *s)
{
    const vi_structure_model *model = s->model;
    vi_structure_state *state = s->state;
    double g[VI_PORTS][VI_PORTS], x[VI_PORTS], v[VI_PORTS], dx[VI_PORTS], dv[VI_PORTS];
    int held[VI_PORTS] = {0};
    signed_matrix(s, s->model->compliance, g);
    for (int k = 0; k < model->contacts; ++k) {
        held[k] = state->status[k] == VI_CONTACT_HELD;
        const double sign = vi_structure_direction(s, k);
        x[k] = sign * (vi_structure_at(model, model->shape[k], state->q) - s->contacts[k].position);
        v[k] = sign * vi_structure_at(model, model->shape[k], state->p);
    }
    vi_solve_active(model->contacts, g, x, held, dx);
    vi_solve_active(model->contacts, g, v, held, dv);
    for (int k = 0; k < model->contacts; ++k) {
        add_push(s, k, dx[k], state->q);
        add_push(s, k, dv[k], state->p);
    }
}

/* ---- rest and release ---- */

void vi_structure_rest(const vi_structure *s, int k, double delay, double tail_impulse)
{
    vi_structure_state *state = s->state;
    vi_contact *contact = &s->contacts[k];
    state->status[k] = VI_CONTACT_HELD;
    state->leaving[k] = 0;
    state->tail_impulse[k] = tail_impulse;
    state->fastest_impact[k] = 0.0;
    state->low_impacts[k] = 0;
    contact->stuck = 1;
    contact->stick_start = vi_clock_time(&s->model->clock, vi_clock_after(&s->model->clock, state->now, delay));
    contact->stick_end = NAN;
}

void vi_structure_release(const vi_structure *s, int k, int leaving)
{
    vi_contact *contact = &s->contacts[k];
    contact->stick_end = vi_clock_time(&s->model->clock, s->state->now);
    contact->stick_start = fmin(contact->stick_start, contact->stick_end); /* lifted before the chatter had ended */
    vi_record_stick(s->record, contact->stick_start, contact->stick_end, k + 1, s->state->tail_impulse[k]);
    contact->stuck = 0;
    s->state->status[k] = VI_CONTACT_TOUCHING;
    s->state->leaving[k] = leaving;
}

/* ---- compliant stops ---- */

void vi_structure_touch_down(const vi_structure *s, int k)
{
    vi_contact *contact = &s->contacts[k];
    const vi_clock *clock = &s->model->clock;
    const double approach = vi_max(0.0, vi_structure_approach(s, k));
    s->state->status[k] = VI_CONTACT_YIELDING;
    s->state->leaving[k] = 0;
    s->state->touch_down[k] = (vi_touch_down){vi_clock_time(clock, s->state->now), vi_clock_phase(clock, s->state->now),
                                              approach, 0.0};
    contact->count += 1;
    contact->last_time = s->state->touch_down[k].time;
    contact->last_phase = s->state->touch_down[k].phase;
    contact->last_velocity = approach;
    contact->impulse = 0.0;
}

/* What has the sign of a compliant contact's force, whether it is pressed or not. */
static double pressing_now(const vi_structure *s, int k)
{
    const vi_contact_law *law = &s->contacts[k].law;
    const double depth = -vi_structure_clearance(s, k), rate = vi_structure_approach(s, k);
    const double damping = law->law == VI_LAW_HERTZ ? 0.0 : law->damping;
    return damping * rate + (law->law == VI_LAW_KELVIN_VOIGT ? law->stiffness * depth : 1.0);
}

void vi_structure_separate(const vi_structure *s, int k, bool receding)
{
    vi_structure_state *state = s->state;
    const vi_touch_down *touch = &state->touch_down[k];
    const double now = vi_clock_time(&s->model->clock, state->now), rebound = -vi_structure_approach(s, k);
    const double restitution = touch->velocity > 0.0 ? vi_max(0.0, rebound) / touch->velocity : 0.0;
    const double penetration = -vi_structure_clearance(s, k);
    const double noise = VI_ROUNDING * vi_structure_displacement_size(s, k);
    /* the last push of a thin contact has thrown it out a little before this instant */
    const double late = penetration < 0.0 && rebound > 0.0 ? -penetration / rebound : 0.0;
    s->contacts[k].impulse = touch->impulse;
    vi_record_contact(s->record, touch->time, touch->phase, touch->velocity, touch->impulse, k + 1, restitution,
                      vi_max(0.0, now - touch->time - late));
    const double surface = vi_max(0.0, penetration), tau = s->contacts[k].relaxation_time;
    state->surface[k] = rebound * tau > surface ? surface : 0.0; /* a surface that is faster follows without force */
    state->separated[k] = state->now;
    const int64_t law = s->contacts[k].law.law;
    const bool linear = law == VI_LAW_KELVIN_VOIGT || law == VI_LAW_EXTERNAL_FORCE;
    /* the force is gone before the penetration, or with it */
    if (receding && (linear ? penetration > WITH_IT * noise : pressing_now(s, k) <= GONE && penetration > noise)) {
        state->status[k] = VI_CONTACT_RECEDING;
    } else {
        state->status[k] = VI_CONTACT_TOUCHING;
        state->leaving[k] = 0;
    }
}

bool vi_structure_surface_lags(const vi_structure *s, int k)
{
    return s->contacts[k].relaxation_time > 0.0 && s->state->surface[k] > 0.0;
}

void vi_structure_return(const vi_structure *s, int k)
{
    if (vi_structure_surface_lags(s, k) && pressing_now(s, k) <= 0.0) {
        s->state->surface[k] = 0.0;
        return;
    }
    vi_structure_touch_down(s, k);
}

/* ---- impacts ---- */

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

/* A contact held at rest from now on: the plastic state, and the force that would hold it. */
typedef struct {
    double p[VI_MODES];
    double mobility;         /* of the contact with those held beside it, 1/kg */
    double pressure, slope, bend; /* acceleration towards the stop if it were free, and its rates, m/s^2, .. m/s^4 */
    double noise;            /* of the pressure */
} held_view;

static void look_at_held(const vi_structure *s, int k, held_view *view)
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
    signed_matrix(s, s->model->compliance, g);
    x[k] = 1.0;
    vi_solve_active(model->contacts, g, x, active, unit); /* 1 / effective mobility = the diagonal of the inverse */
    view->mobility = unit[k] > 0.0 ? 1.0 / unit[k] : HUGE_VAL;
    x[k] = vi_structure_approach(s, k);
    vi_solve_active(model->contacts, g, x, active, unit);
    memcpy(view->p, state->p, sizeof view->p);
    for (int l = 0; l < model->contacts; ++l) {
        add_push(s, l, unit[l], view->p);
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

static chatter_tail sum_tail(const vi_structure *s, int k, const held_view *view, double rebound, double restitution)
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
static void come_to_rest(const vi_structure *s, int k, const held_view *view, double delay, double tail_impulse)
{
    const double before = s->state->follow_energies ? vi_structure_kinetic(s) : 0.0;
    memcpy(s->state->p, view->p, sizeof view->p);
    s->state->energies.contact_loss += s->state->follow_energies ? before - vi_structure_kinetic(s) : 0.0;
    vi_structure_rest(s, k, delay, tail_impulse);
}

/* Rest on stop k now if the bounces still to come can be summed (or are too low, or too many, to be followed). */
static void rest_if_summable(const vi_structure *s, int k, double rebound, double restitution, bool tiny)
{
    held_view view;
    look_at_held(s, k, &view);
    if (rebound == 0.0 && view.slope >= 0.0 && fabs(view.pressure) <= view.noise) {
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

/* One contact after the impulses: count it, and let it rest where its chatter can be summed. */
static void after_impact(const vi_structure *s, int k, double approach, double impulse, double restitution)
{
    vi_structure_state *state = s->state;
    const double rebound = restitution * approach;
    double acceleration[VI_MODES], force[VI_PORTS];
    vi_structure_accelerate(s, acceleration, force);
    const double a = vi_structure_direction(s, k) * vi_structure_at(s->model, s->model->shape[k], acceleration);
    const double resolved = resolution(s, k, a, approach);
    /* below this speed a touch cannot be told from a miss: it stands for less penetration than can be resolved */
    const bool graze = approach * approach <= 2.0 * fabs(a) * resolved;
    if (graze) {
        s->contacts[k].graze_count += 1;
    } else {
        count_impact(s, k, approach, impulse, restitution);
    }
    const double height = LOW_HEIGHT * vi_structure_displacement_size(s, k);
    const bool tiny = a > 0.0 && (rebound * rebound <= 2.0 * a * height || 2.0 * rebound * s->model->fastest <= SHORT_FLIGHT * a);
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
    signed_matrix(s, s->model->mobility, whole);
    signed_matrix(s, s->model->mobility_low, whole_low);
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
        const bool resting = state->status[k] == VI_CONTACT_HELD || (state->status[k] == VI_CONTACT_TOUCHING && state->leaving[k]);
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
    signed_matrix(s, s->model->compliance, g);
    vi_solve_active(s->model->contacts, g, approach, touches, impulse);
    for (int k = 0; k < s->model->contacts; ++k) {
        add_push(s, k, impulse[k], s->state->p);
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
            const bool touches = s->state->status[k] == VI_CONTACT_TOUCHING && !s->state->leaving[k]
                                 && s->contacts[k].law.law == VI_LAW_RESTITUTION;
            now[k] = touches && vi_structure_approach(s, k) > VI_ROUNDING * vi_structure_velocity_size(s, k);
            any |= now[k];
        }
        if (!any) {
            return;
        }
    }
    wedge(s);
}

/* ---- arrival ---- */

/* Put contact k on its stop to the last bit. */
static void put_on_stop(const vi_structure *s, int k)
{
    const vi_structure_model *model = s->model;
    const double displacement = vi_structure_at(model, model->shape[k], s->state->q);
    const double beyond = (displacement - s->contacts[k].position) / model->compliance[k][k];
    for (int j = 0; j < model->modes; ++j) {
        s->state->q[j] -= model->shape[k][j] * beyond;
    }
    s->state->status[k] = VI_CONTACT_TOUCHING;
    s->state->leaving[k] = 0;
}

/* Does this free contact meet its stop at this instant, as far as rounding can tell? */
static bool meets_now(const vi_structure *s, int k)
{
    if (!vi_structure_watched(s, k) || s->state->status[k] != VI_CONTACT_FREE) {
        return false;
    }
    const double v = vi_structure_approach(s, k);
    const double room = SAME_INSTANT * DBL_EPSILON * (vi_structure_displacement_size(s, k) + v * s->state->now.rest);
    return v > VI_ROUNDING * vi_structure_velocity_size(s, k) && vi_structure_clearance(s, k) <= room;
}

static bool is_external(const vi_structure *s, int k)
{
    return s->contacts[k].law.law == VI_LAW_EXTERNAL || s->contacts[k].law.law == VI_LAW_EXTERNAL_FORCE;
}

/* External laws among those that meet: stop there and wait, or (FMI 2.0) note the time and fly through. */
static bool ask(const vi_structure *s, const int hit[], bool stop_here)
{
    bool any = false;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (!hit[k] || !is_external(s, k)) {
            continue;
        }
        s->contacts[k].event_time = vi_clock_time(&s->model->clock, s->state->now);
        s->contacts[k].answered = 0;
        s->state->asking[k] = stop_here;
        if (!any) {
            *(stop_here ? &s->state->pending : &s->state->passed) = k + 1;
        }
        any = true;
    }
    return any;
}

/* Resolve those that are hit: compliant stops begin to yield, rigid ones answer together. */
static void resolve_hits(const vi_structure *s, const int hit[])
{
    int rigid[VI_PORTS] = {0}, any = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        const int64_t law = s->contacts[k].law.law;
        if (hit[k] && (vi_contact_law_is_compliant(law) || law == VI_LAW_EXTERNAL_FORCE)) {
            vi_structure_touch_down(s, k);
        } else if (hit[k]) {
            rigid[k] = any = 1;
        }
    }
    if (any) {
        vi_structure_collide(s, rigid);
    }
}

void vi_structure_meet(const vi_structure *s, int k, bool stop_here)
{
    int hit[VI_PORTS] = {0};
    put_on_stop(s, k);
    hit[k] = 1;
    for (int l = 0; l < s->model->contacts; ++l) {
        if (l != k && meets_now(s, l)) {
            s->state->status[l] = VI_CONTACT_TOUCHING;
            s->state->leaving[l] = 0;
            hit[l] = 1;
        }
    }
    if (!ask(s, hit, stop_here)) {
        resolve_hits(s, hit);
    }
}

void vi_structure_resolve(const vi_structure *s)
{
    int hit[VI_PORTS] = {0};
    for (int k = 0; k < s->model->contacts; ++k) {
        const bool touches = s->state->status[k] == VI_CONTACT_TOUCHING && !s->state->leaving[k];
        hit[k] = s->state->asking[k]
                 || (touches && vi_structure_approach(s, k) > VI_ROUNDING * vi_structure_velocity_size(s, k));
        s->state->asking[k] = 0;
        s->contacts[k].answered = 0;
    }
    s->state->pending = 0;
    resolve_hits(s, hit);
}

/* ---- contacts that touch, at the start of a step or after something happened ---- */

/* Is the point of contact k kept in place by the contacts that are held beside it? */
static bool kept_by_others(const vi_structure *s, int k, double g[VI_PORTS][VI_PORTS])
{
    double column[VI_PORTS], share[VI_PORTS], left = g[k][k];
    int held[VI_PORTS] = {0};
    for (int l = 0; l < s->model->contacts; ++l) {
        held[l] = l != k && s->state->status[l] == VI_CONTACT_HELD;
        column[l] = g[l][k];
    }
    vi_solve_active(s->model->contacts, g, column, held, share);
    for (int l = 0; l < s->model->contacts; ++l) {
        left -= g[k][l] * share[l];
    }
    return left <= KEPT * g[k][k];
}

static bool gives_way(const vi_structure *s, int k)
{
    const int64_t law = s->contacts[k].law.law;
    return vi_contact_law_is_compliant(law) || law == VI_LAW_EXTERNAL_FORCE;
}

/* A compliant or rigid stop that is touched without speed: pressed, or left? */
static void settle_resting(const vi_structure *s, const int candidate[])
{
    vi_structure_state *state = s->state;
    const int n = s->model->contacts;
    double acceleration[VI_MODES], force[VI_PORTS], g[VI_PORTS][VI_PORTS], b[VI_PORTS] = {0.0}, p[VI_PORTS];
    accelerate_freely(s, acceleration, force);
    signed_matrix(s, s->model->compliance, g);
    int index[VI_PORTS], count = 0;
    double small[VI_PORTS][VI_PORTS];
    int rigid = 0;
    for (int turn = 0; turn < 2 * n; ++turn) { /* rigid stops first: a compliant one presses only once it is pressed in */
        const int k = turn % n;
        if (candidate[k] && gives_way(s, k) == (turn >= n)) {
            index[count++] = k;
            rigid += turn < n;
        }
    }
    for (int i = 0; i < count; ++i) {
        const int k = index[i];
        p[i] = 0.0;
        b[i] = vi_structure_direction(s, k) * vi_structure_at(s->model, s->model->shape[k], acceleration);
        for (int j = 0; j < count; ++j) {
            small[i][j] = g[k][index[j]];
        }
    }
    vi_complementary(rigid, small, b, p);
    for (int i = 0; i < count; ++i) {
        const int k = index[i];
        const bool compliant = i >= rigid, was_held = state->status[k] == VI_CONTACT_HELD;
        double gap = -b[i];
        for (int j = 0; j < count; ++j) {
            gap += small[i][j] * p[j];
        }
        held_view view;
        look_at_held(s, k, &view);
        const double noise = compliant ? view.noise / view.mobility * s->model->mobility[k][k] : view.noise;
        const double push = compliant ? -gap : p[i] * view.mobility; /* acceleration that the stop has to take */
        const bool tie = fabs(gap) <= noise && push <= noise;
        const bool idle = (tie || compliant) && kept_by_others(s, k, g);
        const bool presses = idle ? false
                             : tie ? view.slope > 0.0 || (view.slope == 0.0 && state->leaving[k] != 2 && !compliant) || was_held
                                 : push > noise;
        if (presses && compliant) {
            vi_structure_touch_down(s, k);
        } else if (presses && !was_held) {
            vi_structure_rest(s, k, 0.0, 0.0);
        } else if (!presses && was_held) {
            vi_structure_release(s, k, 1);
        } else if (!presses) {
            state->leaving[k] = tie || idle ? 2 : 1;
        }
    }
}

/* Is yielding contact k neither pressed in nor going to be, since rigid stops hold its point where it touches? */
static bool only_touches(const vi_structure *s, int k)
{
    double g[VI_PORTS][VI_PORTS];
    if (fabs(vi_structure_clearance(s, k)) > VI_ROUNDING * vi_structure_displacement_size(s, k)
        || fabs(vi_structure_approach(s, k)) > VI_ROUNDING * vi_structure_velocity_size(s, k)) {
        return false;
    }
    signed_matrix(s, s->model->compliance, g);
    return kept_by_others(s, k, g);
}

void vi_structure_settle(const vi_structure *s, const vi_step_request *request)
{
    vi_structure_state *state = s->state;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (state->status[k] == VI_CONTACT_YIELDING && only_touches(s, k)) {
            vi_structure_separate(s, k, false);
            state->leaving[k] = 2;
        }
    }
    int candidate[VI_PORTS] = {0}, hit[VI_PORTS] = {0}, any_candidate = 0, first = -1;
    for (int k = 0; k < s->model->contacts && !state->pending; ++k) {
        if (!vi_structure_watched(s, k)) {
            continue;
        }
        if (state->status[k] == VI_CONTACT_HELD) {
            candidate[k] = 1;
        } else if (state->status[k] == VI_CONTACT_TOUCHING && state->leaving[k] == 0) {
            const double v = vi_structure_approach(s, k), noise = VI_ROUNDING * vi_structure_velocity_size(s, k);
            hit[k] = v > noise;
            candidate[k] = fabs(v) <= noise;
            first = hit[k] && first < 0 ? k : first;
        } else if (state->status[k] == VI_CONTACT_TOUCHING && state->leaving[k] == 1) {
            candidate[k] = 1;
        }
        any_candidate |= candidate[k] && state->status[k] == VI_CONTACT_TOUCHING;
    }
    if (first >= 0) {
        if (!ask(s, hit, request->stop_at_contacts)) {
            resolve_hits(s, hit);
        }
        return;
    }
    if (any_candidate) {
        settle_resting(s, candidate);
    }
}
