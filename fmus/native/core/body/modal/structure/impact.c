#include "body/modal/structure/impact.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/chatter.h"
#include "body/contact_events.h"
#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/stop_motion.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/impulses.h"
#include "body/modal/structure/resolution.h"
#include "body/modal/structure/sensitivity.h"
#include "contact/complementarity.h"
#include "motion/majorant.h"

/* Rounds of impacts of one event, each set off by the one before; an instant has VI_MOST_EVENTS events at most. Between
 * stops that leave no room the rounds would never end: they end with the first event. */
enum { MOST_ROUNDS = 64 };

/* Approach of a contact elsewhere, relative to the speed of an impact, up to which it is still. A larger approach is an
 * impact of its own. A contact whose load gives it no larger approach within a radian rests without load. */
static const double STILL = 64.0 * DBL_EPSILON;

/* Rounding of a speed after rounds of impacts, in roundings of a single impact. */
static const double MANY_ROUNDINGS = 16.0;

/* Relative to the fastest approach of a round: difference up to which contacts collide together. */
static const double TOGETHER = 1e-9;

/* Height of a bounce, relative to the motion, that any integrator follows; unresolved heights are cut to it. */
static const double HIGHEST_UNRESOLVED = 1e-4;

static double restitution_of(const vi_structure *s, int k, double approach)
{
    const vi_contact *contact = &s->contacts[k];
    const bool is_answered = s->model->asks && vi_contact_law_is_external(contact->law.law);
    return is_answered ? contact->applied_restitution : vi_contact_law_restitution(&contact->law, approach);
}

static double drag_at(const vi_structure *s, int k)
{
    const vi_structure_model *model = s->model;
    double drag = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const double pulled = model->coupled ? vi_structure_at(model, model->coupling[j], model->impulse[k])
                                             : 2.0 * model->mode[j].decay * model->impulse[k][j];
        drag += model->shape[k][j] * pulled;
    }
    return drag / model->mobility[k][k];
}

/* Balance the energies of an impact: moving stops do work on the bodies, the contacts lose the rest. before: kinetic
 * energy, J; impulse: of the contacts, N s. */
static void balance(const vi_structure *s, double before, const double impulse[])
{
    vi_energies *energies = &s->state->energies;
    if (s->state->follow_energies) {
        const double work = VI_STOPS_MOVE ? vi_stop_motions_work(s, impulse) : 0.0;
        energies->forcing_work += work;
        energies->contact_loss += before - vi_structure_kinetic(s) + work;
    }
}

/* Apply the plastic impact that replaces the rest of a chatter sequence, or acts on a stop without rebound. */
static void come_to_rest(const vi_structure *s, int k, const vi_held_view *view, double delay, double tail_impulse)
{
    const double before = s->state->follow_energies ? vi_structure_kinetic(s) : 0.0;
    if (s->sensitive != NULL) {
        vi_sensitivity_rest(s, k, view->impulse);
    }
    memcpy(s->state->p, view->p, sizeof view->p);
    balance(s, before, view->impulse);
    vi_structure_rest(s, k, delay, tail_impulse);
}

/* Stick on stop k now if the remaining bounces can be summed (or are too low, or too many, to be followed). */
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
    const vi_bounces b = {.rebound = rebound,
                          .restitution = restitution,
                          .pressure = view.pressure,
                          .slope = view.slope,
                          .bend = view.bend,
                          .drag = drag_at(s, k),
                          .fastest = s->model->fastest,
                          .moving = s->model->fastest,
                          .resolution = vi_structure_bounce_resolution(s, k, view.pressure, rebound),
                          .tiny = tiny};
    const vi_chatter chatter = vi_chatter_look(&b, s->state->low_impacts[k]);
    if (chatter.sticks) {
        const double impulse = (1.0 + restitution) * rebound / (view.mobility * (1.0 - restitution));
        come_to_rest(s, k, &view, chatter.duration, chatter.summed ? impulse : 0.0);
    }
}

/* Speed at which contact k leaves after the impulses: its law's rebound, or more where others have thrown it off. */
static double rebound_of(const vi_structure *s, int k, double approach, double impulse, double restitution)
{
    const double own = restitution * approach, speed = -vi_structure_approach(s, k);
    const bool thrown = !(impulse > 0.0) && speed > own + VI_ROUNDING * vi_structure_velocity_size(s, k);
    return thrown ? speed : own;
}

void vi_structure_end_bounce(const vi_structure *s, int k)
{
    vi_exchange *exchange = &s->state->exchange;
    const double rebound = -vi_structure_approach(s, k);
    vi_held_view view;
    vi_structure_look_at_held(s, k, &view);
    if (!(rebound > 0.0 && view.pressure > 0.0)) {
        return;
    }
    const double height = 0.5 * rebound * rebound / (view.pressure * sqrt(s->model->compliance[k][k]));
    exchange->unresolved = vi_min(vi_max(exchange->unresolved, height), HIGHEST_UNRESOLVED * exchange->displacement);
    rest_if_summable(s, k, rebound, restitution_of(s, k, rebound), false);
}

static bool is_tiny(double acceleration, double rebound, double fastest, double height)
{
    return acceleration > 0.0 && (!(rebound * rebound > 2.0 * acceleration * height)
                                  || 2.0 * rebound * fastest <= VI_SHORT_FLIGHT * acceleration);
}

/* Finish an impact of one contact: count it, and let it stick where its chatter can be summed. */
static void after_impact(const vi_structure *s, int k, double approach, double impulse, double restitution)
{
    vi_structure_state *state = s->state;
    const double rebound = rebound_of(s, k, approach, impulse, restitution), fastest = s->model->fastest;
    const double size = vi_structure_displacement_size(s, k), height = VI_LOW_HEIGHT * size;
    const double most = vi_structure_most_acceleration(s, k);
    bool graze = false, tiny = false;
    if (!(approach * approach > 2.0 * most * (DBL_EPSILON * size)) || is_tiny(most, rebound, fastest, height)) {
        double acceleration[VI_MODES], force[VI_PORTS];
        vi_structure_accelerate(s, acceleration, force);
        const double a = vi_structure_direction(s, k) * vi_structure_at(s->model, s->model->shape[k], acceleration);
        graze = vi_chatter_is_graze(approach, a, vi_structure_resolution(s, k, a, approach));
        tiny = is_tiny(a, rebound, fastest, height);
    }
    state->budget.events += 1;
    if (graze) {
        s->contacts[k].graze_count += 1;
    } else {
        vi_contact_hit(&s->contacts[k], s->record, &s->model->clock, state->now, k + 1, approach, impulse, restitution);
        if (s->sensitive != NULL) {
            vi_sensitivity_count(s, k, false);
        }
    }
    state->status[k] = VI_CONTACT_TOUCHING;
    state->leaving[k] = rebound == 0.0 ? 1 : 0;
    const bool counted =
        vi_chatter_count(&state->fastest_impact[k], &state->low_impacts[k], approach, rebound, graze, tiny);
    if (counted || state->exchange.on) { /* an integrator cannot follow bounces below its tolerance, not even a few */
        rest_if_summable(s, k, rebound, restitution, tiny);
    }
}

/* ---- contacts at rest during impacts of others ---- */

static bool is_resting(const vi_structure *s, int k)
{
    const int32_t status = s->state->status[k];
    return status == VI_CONTACT_HELD || (status == VI_CONTACT_TOUCHING && s->state->leaving[k]);
}

/* Is resting contact k without load, and would it rebound from an impact? */
static bool is_idle(const vi_structure *s, int k)
{
    const double speed = s->state->cascade.speed;
    if (!(restitution_of(s, k, speed) > 0.0)) {
        return false;
    }
    vi_held_view view;
    vi_structure_look_at_held(s, k, &view);
    return view.pressure <= vi_max(view.noise, STILL * s->model->fastest * speed);
}

/* Can all these contacts leave their stops at once? */
static bool leave_room(const vi_structure *s, const int chosen[])
{
    double whole[VI_PORTS][VI_PORTS], g[VI_PORTS][VI_PORTS], away[VI_PORTS] = {0.0}, p[VI_PORTS];
    int index[VI_PORTS], count = 0;
    vi_structure_signed(s, s->model->compliance, whole);
    for (int k = 0; k < s->model->contacts; ++k) {
        if (chosen[k]) {
            index[count++] = k;
        }
    }
    for (int i = 0; i < count; ++i) {
        away[i] = sqrt(whole[index[i]][index[i]]);
        for (int j = 0; j < count; ++j) {
            g[i][j] = whole[index[i]][index[j]];
        }
    }
    vi_complementary(count, g, away, p);
    for (int i = 0; i < count; ++i) {
        double speed = 0.0;
        for (int j = 0; j < count; ++j) {
            speed += g[i][j] * p[j];
        }
        if (!(speed >= 0.5 * away[i])) {
            return false;
        }
    }
    return true;
}

/* Find the contacts that take part in a round: the hit ones, and resting ones, which may not be pushed in. A resting
 * contact without load takes no part: an impact that reaches it is the next. */
static void find_in_play(const vi_structure *s, const int hit[], int in_play[])
{
    int touching[VI_PORTS], idle[VI_PORTS], any = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        in_play[k] = touching[k] = hit[k] || is_resting(s, k);
        idle[k] = !hit[k] && in_play[k] && is_idle(s, k);
        any |= idle[k];
    }
    const bool apart = any && leave_room(s, touching);
    for (int k = 0; k < s->model->contacts; ++k) {
        in_play[k] = in_play[k] && !(apart && idle[k]);
    }
}

/* A round has changed the speed of resting contact k: does it still rest? */
static void stay_or_part(const vi_structure *s, int k, bool in_play, double impulse)
{
    vi_structure_state *state = s->state;
    const double v = vi_structure_approach(s, k), noise = VI_ROUNDING * vi_structure_velocity_size(s, k);
    s->contacts[k].total_impulse += in_play ? impulse : 0.0;
    if (state->leaving[k] > 1) {
        state->leaving[k] = 1; /* its acceleration may have changed */
    }
    const bool parts = in_play ? !(impulse > 0.0) && v < -noise : fabs(v) > vi_max(noise, STILL * state->cascade.speed);
    if (parts) {
        if (state->status[k] == VI_CONTACT_HELD) {
            vi_structure_release(s, k, 0);
        }
        state->leaving[k] = 0;
    }
}

/* One round: every hit contact demands its rebound; a contact that rests on its stop may only not be pushed in. */
static void collide_once(const vi_structure *s, const int hit[VI_PORTS])
{
    vi_structure_state *state = s->state;
    const int n = s->model->contacts;
    double approach[VI_PORTS], restitution[VI_PORTS], change[VI_PORTS], impulse[VI_PORTS], impulse_low[VI_PORTS];
    int in_play[VI_PORTS], resting[VI_PORTS];
    change[0] = 0.0; /* there is a contact, which compilers cannot know */
    in_play[0] = 0;
    const double before = vi_structure_kinetic(s);
    for (int k = 0; k < n; ++k) {
        approach[k] = restitution[k] = change[k] = 0.0;
        resting[k] = !hit[k] && is_resting(s, k);
        if (hit[k]) {
            approach[k] = vi_max(0.0, vi_structure_approach(s, k));
            restitution[k] = restitution_of(s, k, approach[k]);
            change[k] = (1.0 + restitution[k]) * approach[k];
            state->cascade.speed = vi_max(state->cascade.speed, approach[k]);
        }
    }
    find_in_play(s, hit, in_play);
    vi_structure_joint_impulses(s, in_play, change, impulse, impulse_low);
    if (s->sensitive != NULL) {
        vi_sensitivity_impact(s, hit, in_play, approach, impulse);
    }
    vi_structure_give_impulses(s, impulse, impulse_low);
    balance(s, before, impulse);
    for (int k = 0; k < n; ++k) {
        if (resting[k]) {
            stay_or_part(s, k, in_play[k], impulse[k]);
        }
    }
    for (int k = 0; k < n; ++k) {
        if (hit[k]) {
            after_impact(s, k, approach[k], impulse[k], restitution[k]);
        }
    }
}

/* Take the speed of these contacts, which touch their stops. */
static void stop_contacts(const vi_structure *s, const int chosen[])
{
    double g[VI_PORTS][VI_PORTS], approach[VI_PORTS] = {0.0}, impulse[VI_PORTS];
    const double before = vi_structure_kinetic(s);
    for (int k = 0; k < s->model->contacts; ++k) {
        approach[k] = vi_structure_approach(s, k);
    }
    vi_structure_signed(s, s->model->compliance, g);
    vi_solve_active(s->model->contacts, g, approach, chosen, impulse);
    if (s->sensitive != NULL) {
        vi_sensitivity_stop(s, chosen, impulse);
    }
    for (int k = 0; k < s->model->contacts; ++k) {
        vi_structure_push(s, k, impulse[k], s->state->p);
        s->contacts[k].total_impulse += impulse[k];
    }
    balance(s, before, impulse);
}

/* A body between stops that leave no room: every touching contact comes to rest. False where the stops leave room. */
static bool wedge(const vi_structure *s)
{
    int touches[VI_PORTS] = {0};
    for (int k = 0; k < s->model->contacts; ++k) {
        const int32_t status = s->state->status[k];
        touches[k] = status == VI_CONTACT_TOUCHING || status == VI_CONTACT_HELD;
    }
    if (leave_room(s, touches)) {
        return false;
    }
    stop_contacts(s, touches);
    return true;
}

void vi_structure_take_impulses(const vi_structure *s)
{
    vi_structure_state *state = s->state;
    double impulse[VI_PORTS], low[VI_PORTS] = {0.0};
    bool any = false;
    if (state->pending) {
        return; /* an impact comes first */
    }
    for (int k = 0; k < s->model->contacts; ++k) {
        vi_contact *contact = &s->contacts[k];
        impulse[k] = -vi_structure_direction(s, k) * contact->applied_impulse;
        if (contact->applied_impulse != 0.0) {
            any = true;
            vi_contact_struck(contact, vi_clock_time(&s->model->clock, state->now));
        }
    }
    if (!any) {
        return;
    }
    vi_structure_give_impulses(s, impulse, low);
    for (int k = 0; k < s->model->contacts; ++k) {
        if (state->status[k] == VI_CONTACT_HELD) {
            vi_structure_release(s, k, 0);
        }
    }
    for (int k = 0; k < s->model->contacts; ++k) {
        if (state->status[k] == VI_CONTACT_TOUCHING) {
            state->leaving[k] = 0;
        }
    }
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        state->origin[j].known = 0;
    }
}

/* Does contact k, which an impact of this instant may have thrown in, touch its stop without a decision to rest? */
static bool is_exposed(const vi_structure *s, int k)
{
    vi_structure_state *state = s->state;
    if (s->model->stop[k] != VI_RIGID_STOP || vi_contact_law_is_external(s->contacts[k].law.law)) {
        return false;
    }
    if (vi_structure_meets_now(s, k)) { /* thrown against its stop by the last round, in a corner */
        state->status[k] = VI_CONTACT_TOUCHING;
        state->leaving[k] = 0;
    }
    return state->status[k] == VI_CONTACT_TOUCHING && !state->leaving[k];
}

/* Find the contacts of the next round: the fastest approach, with others as fast. False where none approaches; contacts
 * of many rounds that neither approach nor leave are then at rest. */
static bool find_next_round(const vi_structure *s, int next[])
{
    const vi_cascade *cascade = &s->state->cascade;
    double approach[VI_PORTS], fastest = 0.0;
    int still[VI_PORTS], any = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        const bool exposed = is_exposed(s, k);
        const double v = exposed ? vi_structure_approach(s, k) : 0.0;
        const double rounding = (cascade->rounds > 1 ? MANY_ROUNDINGS : 1.0) * VI_ROUNDING;
        const double least = vi_max(rounding * vi_structure_velocity_size(s, k), STILL * cascade->speed);
        still[k] = exposed && fabs(v) <= least;
        any |= still[k];
        approach[k] = v > least ? v : 0.0;
        fastest = vi_max(fastest, approach[k]);
    }
    for (int k = 0; k < s->model->contacts; ++k) {
        next[k] = approach[k] > 0.0 && approach[k] >= (1.0 - TOGETHER) * fastest;
    }
    if (!(fastest > 0.0) && any && cascade->rounds > 1) {
        stop_contacts(s, still);
        for (int k = 0; k < s->model->contacts; ++k) {
            s->state->leaving[k] = still[k] ? 1 : s->state->leaving[k];
        }
    }
    return fastest > 0.0;
}

/* Rounds of impacts, from these on, until no contact approaches its stop, or until the event ends. */
static void cascade(const vi_structure *s, int next[])
{
    vi_cascade *cascade = &s->state->cascade;
    for (int round = 0; round < MOST_ROUNDS; ++round) {
        collide_once(s, next);
        cascade->rounds += 1;
        if (!find_next_round(s, next) || (cascade->rounds == MOST_ROUNDS && wedge(s))) {
            *cascade = (vi_cascade){0, 0.0};
            return;
        }
        if (vi_record_full(s->record) && !s->record->reported) {
            return; /* the importer takes the rows first */
        }
    }
}

void vi_structure_collide(const vi_structure *s, const int hit[VI_PORTS])
{
    int next[VI_PORTS];
    memcpy(next, hit, (size_t)s->model->contacts * sizeof *next);
    s->state->cascade = (vi_cascade){0, 0.0};
    cascade(s, next);
}

void vi_structure_collide_on(const vi_structure *s)
{
    int next[VI_PORTS];
    if (!find_next_round(s, next)) {
        s->state->cascade = (vi_cascade){0, 0.0};
        return;
    }
    cascade(s, next);
}
