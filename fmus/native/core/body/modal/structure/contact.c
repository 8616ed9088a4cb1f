#include "body/modal/structure/contact.h"

#include <float.h>
#include <math.h>

#include "body/contact_events.h"
#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/structure/sensitivity.h"
#include "motion/majorant.h"

/* Clearance, in roundings of the displacement, below which contacts meet at the same instant. */
static const double SAME_INSTANT = 16.0;
/* Penetration, in roundings, above which a contact recedes after its force has ended; below, it ends with its
 * penetration. ENDED: value of 1 + damping d' up to which the force of a power law counts as ended. */
static const double RECEDES = 4.0, ENDED = 1e-9;

/* ---- sticking and release ---- */

void vi_structure_rest(const vi_structure *s, int k, double delay, double tail_impulse)
{
    vi_structure_state *state = s->state;
    state->budget.events += 1;
    state->status[k] = VI_CONTACT_HELD;
    state->series = 0;
    state->leaving[k] = 0;
    state->tail_impulse[k] = tail_impulse;
    s->contacts[k].total_impulse += tail_impulse;
    state->fastest_impact[k] = 0.0;
    state->low_impacts[k] = 0;
    vi_contact_stick(&s->contacts[k], &s->model->clock, state->now, delay);
}

/* Is the rest that ends at contact k to be recorded? A body let go at this very instant may be found pressed again by
 * the rounding of its loads, for a time of rounding size. */
static bool is_rest(const vi_structure *s, int k)
{
    const vi_contact *contact = &s->contacts[k];
    const double rounding = VI_ROUNDING * fabs(contact->stick_end);
    return contact->stick_end - contact->stick_start > rounding || s->state->tail_impulse[k] > 0.0;
}

/* List the contacts that touch only because contact k holds their point. */
static void find_held_by(const vi_structure *s, int k, int touching[])
{
    const int32_t status = s->state->status[k];
    for (int l = 0; l < s->model->contacts; ++l) {
        touching[l] = s->state->status[l] == VI_CONTACT_TOUCHING && vi_structure_only_touches(s, l);
    }
    s->state->status[k] = VI_CONTACT_TOUCHING;
    for (int l = 0; l < s->model->contacts; ++l) {
        touching[l] = touching[l] && !vi_structure_only_touches(s, l);
    }
    s->state->status[k] = status;
}

void vi_structure_release(const vi_structure *s, int k, int leaving)
{
    vi_contact *contact = &s->contacts[k];
    int touching[VI_PORTS];
    vi_contact_lift(contact, &s->model->clock, s->state->now);
    if (!contact->earlier && is_rest(s, k)) {
        vi_record_stick(s->record, contact->stick_start, contact->stick_end, k + 1, s->state->tail_impulse[k]);
    }
    find_held_by(s, k, touching);
    s->state->status[k] = VI_CONTACT_TOUCHING;
    s->state->leaving[k] = leaving;
    for (int l = 0; l < s->model->contacts; ++l) {
        s->state->leaving[l] = touching[l] ? 1 : s->state->leaving[l];
    }
}

/* ---- compliant stops ---- */

/* Count a contact once, in the period in which it begins. */
static void count_once(const vi_structure *s, int k)
{
    s->record->period_impacts += !s->state->touch_down[k].counted;
    s->state->touch_down[k].counted = 1;
}

void vi_structure_touch_down(const vi_structure *s, int k)
{
    vi_contact *contact = &s->contacts[k];
    const vi_clock *clock = &s->model->clock;
    const double v = vi_structure_approach(s, k), size = vi_structure_displacement_size(s, k);
    const double approach = v > VI_ROUNDING * vi_structure_velocity_size(s, k) ? v : 0.0;
    s->state->budget.events += 1;
    s->state->status[k] = VI_CONTACT_YIELDING;
    s->state->series = 0;
    s->state->power_level = INT32_MAX;
    s->state->leaving[k] = 0;
    /* a contact that begins now begins at depth 0: a graze ends before its depth would exceed rounding */
    if (fabs(vi_structure_clearance(s, k)) <= SAME_INSTANT * DBL_EPSILON * size) {
        s->state->leaving[k] = approach > 0.0 ? 1 : 2;
    }
    s->state->touch_down[k] = (vi_touch_down){vi_clock_time(clock, s->state->now), vi_clock_phase(clock, s->state->now),
                                              approach, 0.0, 0.0, 0};
    if (approach > 0.0) {
        count_once(s, k);
    }
    contact->earlier = 0;
    contact->count += 1;
    contact->last_time = s->state->touch_down[k].time;
    contact->last_phase = s->state->touch_down[k].phase;
    contact->last_velocity = approach;
    contact->impulse = 0.0;
    if (s->sensitive != NULL) {
        vi_sensitivity_count(s, k, true);
    }
}

/* A number with the sign of a compliant contact's force, whether the contact is pressed or not. */
static double pressing_now(const vi_structure *s, int k)
{
    const vi_press press = vi_structure_stop_press(s, k);
    return vi_press_sense(&press, -vi_structure_clearance(s, k), vi_structure_approach(s, k));
}

/* A contact that ends as it begins, without speed, has only touched. It stays so until something moves. */
static bool only_touched(const vi_structure *s, int k)
{
    if (s->state->leaving[k] != 2) {
        return false;
    }
    s->contacts[k].count -= 1;
    s->state->status[k] = VI_CONTACT_TOUCHING;
    return true;
}

/* Is a contact, so far, a touch of rounding size and no impact? Such a touch began without speed, has no impulse and
 * does not go in now. The impulse is known only where the force is integrated here. */
static bool is_rounding(const vi_structure *s, int k)
{
    const vi_touch_down *touch = &s->state->touch_down[k];
    const double noise = VI_ROUNDING * vi_structure_velocity_size(s, k);
    return !s->state->exchange.on && touch->velocity == 0.0 && touch->impulse * s->model->mobility[k][k] <= noise &&
           vi_structure_approach(s, k) <= noise;
}

void vi_structure_separate(const vi_structure *s, int k, bool receding)
{
    vi_structure_state *state = s->state;
    if (only_touched(s, k)) {
        return;
    }
    const vi_touch_down *touch = &state->touch_down[k];
    const double now = vi_clock_time(&s->model->clock, state->now), rebound = -vi_structure_approach(s, k);
    const double restitution = touch->velocity > 0.0 ? vi_max(0.0, rebound) / touch->velocity : 0.0;
    const double penetration = -vi_structure_clearance(s, k);
    const double noise = VI_ROUNDING * vi_structure_displacement_size(s, k);
    /* the last push of a thin contact has thrown it out shortly before this instant */
    const double late = penetration < 0.0 && rebound > 0.0 ? -penetration / rebound : 0.0;
    if (is_rounding(s, k)) {
        s->contacts[k].count -= 1;
    } else {
        s->contacts[k].impulse = touch->impulse;
        count_once(s, k);
        if (!s->contacts[k].earlier) {
            vi_record_contact(s->record, touch->time, touch->phase, touch->velocity, touch->impulse, k + 1, restitution,
                              vi_max(0.0, now - touch->time - late), touch->peak);
        }
    }
    const double surface = vi_max(0.0, penetration), tau = s->contacts[k].relaxation_time;
    state->surface[k] = rebound * tau > surface ? surface : 0.0; /* a faster surface follows without force */
    state->separated[k] = state->now;
    const bool linear = vi_structure_stop_press(s, k).kind == VI_PRESS_LINEAR;
    /* the force ends before the penetration, or with it */
    if (receding && (linear ? penetration > RECEDES * noise : pressing_now(s, k) <= ENDED && penetration > noise)) {
        state->status[k] = VI_CONTACT_RECEDING;
    } else {
        /* after an impact elsewhere it may be off its stop, and on its way back */
        state->status[k] = -penetration > SAME_INSTANT / 4.0 * noise ? VI_CONTACT_FREE : VI_CONTACT_TOUCHING;
        state->leaving[k] = 0;
    }
}

static void meet_force(const vi_structure *s, int k)
{
    const bool is_pressed = s->contacts[k].applied_force > 0.0;
    if (s->state->status[k] == VI_CONTACT_RECEDING && is_pressed) {
        vi_structure_touch_down(s, k);
    } else if (s->state->status[k] == VI_CONTACT_YIELDING && !is_pressed && !s->state->moved
               && vi_structure_approach(s, k) < 0.0) {
        vi_structure_separate(s, k, true);
    }
}

void vi_structure_meet_forces(const vi_structure *s)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->model->stop[k] == VI_YIELDING_STOP && vi_contact_law_is_external(s->contacts[k].law.law)) {
            meet_force(s, k);
        }
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

/* ---- contacts that go on ---- */

void vi_structure_begin_recording(const vi_structure *s)
{
    const double now = vi_clock_time(&s->model->clock, s->state->now);
    s->record->period_impacts = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        const bool yields = s->state->status[k] == VI_CONTACT_YIELDING, before = s->state->moved != 0;
        const bool sticks = s->state->status[k] == VI_CONTACT_HELD && s->contacts[k].stick_start <= now;
        s->contacts[k].earlier = before && (yields || sticks);
        s->state->touch_down[k].counted = before;
        if (yields && !before && s->state->touch_down[k].velocity > 0.0) {
            count_once(s, k); /* pressed in by the start state */
        }
    }
}

void vi_structure_count_contacts(const vi_structure *s)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->state->status[k] == VI_CONTACT_YIELDING && !is_rounding(s, k)) {
            count_once(s, k);
        }
    }
}

bool vi_structure_is_open(const vi_structure *s, int k)
{
    const vi_contact *contact = &s->contacts[k];
    if (!s->record->recording || contact->earlier) {
        return false;
    }
    if (s->state->status[k] == VI_CONTACT_HELD) {
        return contact->stick_start <= vi_clock_time(&s->model->clock, s->state->now);
    }
    return s->state->status[k] == VI_CONTACT_YIELDING && !is_rounding(s, k);
}

/* ---- on the stop ---- */

void vi_structure_put_on_stop(const vi_structure *s, int k)
{
    const vi_structure_model *model = s->model;
    const double displacement = vi_structure_at(model, model->shape[k], s->state->q);
    const double beyond = (displacement - s->contacts[k].position) / model->compliance[k][k];
    for (int j = 0; j < vi_structure_free_modes(model); ++j) {
        s->state->q[j] -= model->shape[k][j] * beyond;
    }
    s->state->status[k] = VI_CONTACT_TOUCHING;
    s->state->leaving[k] = 0;
}

bool vi_structure_meets_now(const vi_structure *s, int k)
{
    if (!vi_structure_watched(s, k) || s->state->status[k] != VI_CONTACT_FREE) {
        return false;
    }
    const double v = vi_structure_approach(s, k);
    if (!(v > 0.0)) {
        return false;
    }
    const double room = SAME_INSTANT * DBL_EPSILON * (vi_structure_displacement_size(s, k) + v * s->state->now.rest);
    return vi_structure_clearance(s, k) <= room && v > VI_ROUNDING * vi_structure_velocity_size(s, k);
}
