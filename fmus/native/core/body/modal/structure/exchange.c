#include "body/modal/structure/exchange.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "body/landing.h"
#include "body/law_check.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/loads.h"
#include "body/modal/structure/arrival.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/impact.h"
#include "body/modal/structure/settle.h"
#include "body/step.h"

/* Offset of an indicator's change of sign, in roundings: a contact that just left or met its stop signals only once. */
static const double INDICATED = 16.0;
/* Most checks of the contacts at one instant; in a corner each check may set off others. */
enum { MOST_LOOKS = 2 * VI_PORTS };

void vi_exchange_enable(const vi_exchange_body *body)
{
    body->parts.state->exchange.on = 1;
}

/* ---- start ---- */

static bool is_inside(int64_t law)
{
    return !vi_contact_law_is_external(law);
}

static void check_contact(const vi_contact *contact, int k, char *message)
{
    if (!is_inside(contact->law.law)) {
        char name[48];
        (void)snprintf(name, sizeof name, "contact[%d].law", k + 1);
        vi_complain_of_law(message, name, "a law that the body evaluates itself in model exchange, ", is_inside,
                           contact->law.law);
    } else if (vi_contact_law_yields(contact->law.law) && contact->relaxation_time > 0.0) {
        vi_complain(message, "contact[%d].relaxation_time: expected 0 in model exchange, got %.17g", k + 1,
                    contact->relaxation_time);
    }
}

static bool is_supported(const vi_exchange_body *body, char *message)
{
    const vi_structure *s = &body->parts;
    for (int k = 0; k < s->model->contacts; ++k) {
        check_contact(&s->contacts[k], k, message);
    }
    if (body->refused != NULL) {
        vi_complain(message, "%s: expected 0 in model exchange, got another value", body->refused);
    }
    if (s->record->impacts || s->record->extrema || s->record->periods || s->state->follow_energies) {
        vi_complain(message, "record: expected it to be off in model exchange, got it on");
    }
    if (message[0] != '\0') {
        vi_complain(message, "use this component by co-simulation, which has all of this");
    }
    return message[0] == '\0';
}

/* Set the nominal values from the loads, the start and the stops. */
static void find_nominals(const vi_structure *s)
{
    const vi_structure_model *model = s->model;
    const vi_structure_state *state = s->state;
    double displacement = 0.0, velocity = 0.0, slowest = 0.0;
    for (int j = 0; j < vi_structure_free_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        const double own = mode->natural > 0.0 ? mode->natural : mode->angular_frequency;
        const double rate = own > 0.0 ? own : 1.0;
        const double static_displacement = (mode->force_size + fabs(state->held[j])) / (rate * rate);
        displacement = vi_max(displacement, vi_max(fabs(state->q[j]), static_displacement));
        displacement = vi_max(displacement, fabs(state->p[j]) / rate);
        velocity = vi_max(velocity, vi_max(fabs(state->p[j]), static_displacement * rate));
        slowest = slowest > 0.0 ? vi_min(slowest, rate) : rate;
    }
    for (int k = 0; k < model->contacts; ++k) {
        const double mobility = model->compliance[k][k];
        if (!vi_contact_law_is_none(s->contacts[k].law.law) && mobility > 0.0) {
            displacement = vi_max(displacement, fabs(s->contacts[k].position) / sqrt(mobility));
        }
    }
    const bool still = !(displacement > 0.0) || !isfinite(displacement);
    s->state->exchange.displacement = still ? 1.0 : displacement;
    s->state->exchange.velocity = vi_max(velocity, slowest * s->state->exchange.displacement);
}

bool vi_exchange_begin(const vi_exchange_body *body, char message[VI_MESSAGE_LENGTH])
{
    if (!is_supported(body, message)) {
        return false;
    }
    find_nominals(&body->parts);
    body->parts.state->exchange.unresolved = 0.0;
    return true;
}

/* ---- states ---- */

bool vi_exchange_set_time(const vi_exchange_body *body, double time)
{
    vi_instant instant;
    if (!isfinite(time) || !vi_clock_instant(&body->parts.model->clock, time, 0.0, &instant)) {
        return false;
    }
    body->parts.state->now = instant;
    vi_structure_load(&body->parts);
    return true;
}

/* From the body's modes to the states of the description; states beyond the modes in use are 0. */
static void show(const vi_exchange_body *body, const double modal[], double shown[])
{
    const int used = vi_structure_free_modes(body->parts.model);
    for (int j = 0; j < body->modes; ++j) {
        if (body->shape != NULL) {
            shown[j] = j < used ? vi_structure_at(body->parts.model, body->shape[j], modal) : 0.0;
        } else {
            shown[j] = j < used ? modal[j] / body->scale : 0.0;
        }
    }
}

/* From the states of the description to the body's modes: q = Psi' M x is the inverse of x = Psi q. */
static void take(const vi_exchange_body *body, const double shown[], double modal[])
{
    const int used = vi_structure_free_modes(body->parts.model);
    for (int j = 0; j < used; ++j) {
        modal[j] = body->shape != NULL ? 0.0 : body->scale * shown[j];
        for (int i = 0; i < used && body->shape != NULL; ++i) {
            modal[j] += body->shape[i][j] * body->mass[i] * shown[i];
        }
    }
}

void vi_exchange_get_states(const vi_exchange_body *body, double states[])
{
    show(body, body->parts.state->q, states);
    show(body, body->parts.state->p, states + body->modes);
}

void vi_exchange_set_states(const vi_exchange_body *body, const double states[])
{
    take(body, states, body->parts.state->q);
    take(body, states + body->modes, body->parts.state->p);
}

bool vi_exchange_states_are_finite(const vi_exchange_body *body)
{
    bool finite = true;
    for (int j = 0; j < vi_structure_free_modes(body->parts.model); ++j) {
        finite = finite && isfinite(body->parts.state->q[j]) && isfinite(body->parts.state->p[j]);
    }
    return finite;
}

void vi_exchange_get_nominals(const vi_exchange_body *body, double nominals[])
{
    for (int j = 0; j < body->modes; ++j) {
        const double scale = body->mass == NULL ? body->scale : j < vi_structure_free_modes(body->parts.model) ? sqrt(body->mass[j]) : 1.0;
        nominals[j] = body->parts.state->exchange.displacement / scale;
        nominals[body->modes + j] = body->parts.state->exchange.velocity / scale;
    }
}

void vi_exchange_get_derivatives(const vi_exchange_body *body, double derivatives[])
{
    double acceleration[VI_MODES], force[VI_PORTS];
    vi_structure_accelerate(&body->parts, acceleration, force);
    show(body, body->parts.state->p, derivatives);
    show(body, acceleration, derivatives + body->modes);
}

/* ---- indicators ---- */

/* A depth with the sign of a compliant contact's force, m. For a linear law it is the depth at which the force at rest
 * is as large. For a power law it is 1 + damping d' times the depth that is typical of this motion. */
static double pressing_depth(const vi_structure *s, int k)
{
    const vi_press press = vi_structure_stop_press(s, k);
    const double typical = s->state->exchange.displacement * sqrt(s->model->compliance[k][k]);
    return vi_press_sense_depth(&press, -vi_structure_clearance(s, k), vi_structure_approach(s, k), typical);
}

/* Resolution of a displacement of contact k, m: from its terms, and from the velocity times a radian. */
static double resolution(const vi_structure *s, int k)
{
    const double fastest = s->model->fastest;
    const double reach = fastest > 0.0 ? vi_structure_velocity_size(s, k) / fastest : 0.0;
    return INDICATED * DBL_EPSILON * (vi_structure_displacement_size(s, k) + reach);
}

/* Indicator of contact k, > 0 as long as its status stays; `force`: forces of the held contacts. */
static double indicator(const vi_structure *s, int k, const double force[])
{
    const double clearance = vi_structure_clearance(s, k), room = resolution(s, k);
    const double force_scale = s->model->compliance[k][k];
    const double rate = s->model->fastest > 0.0 ? s->model->fastest : 1.0;
    switch (s->state->status[k]) {
    case VI_CONTACT_HELD: return force[k] * force_scale / (rate * rate) + room;
    case VI_CONTACT_YIELDING:
        return (vi_structure_press(s, k).kind == VI_PRESS_LINEAR ? pressing_depth(s, k)
                                                                 : vi_min(-clearance, pressing_depth(s, k))) + room;
    case VI_CONTACT_RECEDING: return vi_min(-clearance, -pressing_depth(s, k)) + room;
    case VI_CONTACT_TOUCHING: return vi_structure_only_touches(s, k) ? HUGE_VAL : room;
    default: return clearance + room;
    }
}

void vi_exchange_get_indicators(const vi_exchange_body *body, double indicators[])
{
    const vi_structure *s = &body->parts;
    double acceleration[VI_MODES], force[VI_PORTS];
    const double typical = s->state->exchange.displacement;
    vi_structure_accelerate(s, acceleration, force);
    for (int k = 0; k < body->contacts; ++k) {
        const bool watched = k < s->model->contacts && vi_structure_watched(s, k);
        indicators[k] = watched ? vi_min(indicator(s, k, force), DBL_MAX) : typical;
        indicators[k] = indicators[k] < DBL_MAX ? indicators[k] : typical;
    }
}

void vi_exchange_show_indicators(const vi_exchange_body *body)
{
    double indicators[VI_PORTS];
    vi_exchange_get_indicators(body, indicators);
    for (int k = 0; k < body->contacts; ++k) {
        body->parts.contacts[k].indicator = indicators[k];
    }
}

/* ---- events ---- */

/* A free contact has reached its stop: is it hit? Not if it is on its way off, apart from the integrator's error. */
static int arrive(const vi_structure *s, int k)
{
    const double approach = vi_structure_approach(s, k), noise = VI_ROUNDING * vi_structure_velocity_size(s, k);
    const bool rigid = s->model->stop[k] == VI_RIGID_STOP;
    if (rigid) {
        vi_structure_put_on_stop(s, k);
    }
    s->state->status[k] = VI_CONTACT_TOUCHING;
    s->state->leaving[k] = 0;
    if (rigid && approach < -noise) {
        vi_structure_end_bounce(s, k);
    }
    return approach > noise;
}

/* Act on the sign of the indicator of contact k; true when the contact is hit. */
static int look_at(const vi_structure *s, int k, const double force[])
{
    if (!vi_structure_watched(s, k) || indicator(s, k, force) > 0.0) {
        return 0;
    }
    switch (s->state->status[k]) {
    case VI_CONTACT_HELD: vi_structure_release(s, k, 1); break;
    case VI_CONTACT_YIELDING: vi_structure_separate(s, k, true); break;
    case VI_CONTACT_RECEDING:
        if (vi_structure_clearance(s, k) >= 0.0) {
            s->state->status[k] = VI_CONTACT_FREE;
        } else {
            vi_structure_return(s, k);
        }
        break;
    case VI_CONTACT_FREE: return arrive(s, k);
    default: break;
    }
    return 0;
}

static void look_at_all(const vi_structure *s)
{
    double acceleration[VI_MODES], force[VI_PORTS];
    int hit[VI_PORTS] = {0}, any = 0;
    vi_structure_accelerate(s, acceleration, force);
    for (int k = 0; k < s->model->contacts; ++k) {
        hit[k] = look_at(s, k, force);
        any |= hit[k];
    }
    for (int k = 0; k < s->model->contacts && any; ++k) {
        if (!hit[k] && vi_structure_meets_now(s, k)) {
            hit[k] = arrive(s, k);
        }
    }
    if (any) {
        vi_structure_resolve_hits(s, hit);
    }
}

/* Resolve impacts set off by impacts, rests and releases, until nothing more happens at this instant. */
static void settle(const vi_structure *s)
{
    for (int look = 0; look < MOST_LOOKS; ++look) {
        int32_t status[VI_PORTS], leaving[VI_PORTS];
        double p[VI_MODES];
        memcpy(status, s->state->status, sizeof status);
        memcpy(leaving, s->state->leaving, sizeof leaving);
        memcpy(p, s->state->p, sizeof p);
        vi_structure_settle(s, false);
        if (memcmp(status, s->state->status, sizeof status) == 0 && memcmp(p, s->state->p, sizeof p) == 0
            && memcmp(leaving, s->state->leaving, sizeof leaving) == 0) {
            return;
        }
    }
}

bool vi_exchange_event(const vi_exchange_body *body, bool *changed, bool *limit, char message[VI_MESSAGE_LENGTH])
{
    const vi_structure *s = &body->parts;
    double q[VI_MODES], p[VI_MODES];
    const size_t size = (size_t)vi_structure_modes(s->model) * sizeof q[0];
    int32_t status[VI_PORTS];
    memcpy(q, s->state->q, size);
    memcpy(p, s->state->p, size);
    memcpy(status, s->state->status, sizeof status);
    look_at_all(s);
    settle(s);
    vi_structure_project(s);
    /* some integrators keep their past steps unless a state has jumped: changed forces count as a jump too */
    *changed = memcmp(q, s->state->q, size) != 0 || memcmp(p, s->state->p, size) != 0
               || memcmp(status, s->state->status, sizeof status) != 0;
    *limit = s->model->impact_limit > 0 && s->state->budget.events >= s->model->impact_limit;
    if (vi_clock_stands(&s->state->standstill, s->state->now)) {
        vi_structure_complain(s, message);
        return false;
    }
    return true;
}

void vi_exchange_go_on(const vi_exchange_body *body)
{
    const vi_structure *s = &body->parts;
    for (int k = 0; k < s->model->contacts; ++k) {
        const int32_t status = s->state->status[k];
        if (status == VI_CONTACT_TOUCHING && !vi_structure_only_touches(s, k)) {
            s->state->status[k] = VI_CONTACT_FREE;
        }
        if (status == VI_CONTACT_YIELDING || s->state->status[k] == VI_CONTACT_FREE) {
            s->state->leaving[k] = 0;
        }
    }
}
