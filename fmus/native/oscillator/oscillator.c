#include "oscillator.h"

#include <math.h>
#include <string.h>

#include "component.h"
#include "engine.h"
#include "oscillator_variables.h"

/* An importer's communication point may differ from the oscillator's own time by this times (1 + |time|), s. */
static const double TIME_MISMATCH = 1e-9;
/* Default relative error of a contact with law hertz or hunt_crossley. */
static const double CONTACT_TOLERANCE = 1e-10;

static void defaults(void *self)
{
    oscillator *o = self;
    o->mass = o->stiffness = 1.0;
    o->contacts_described = VI_BODY_CONTACTS;
    o->contact_tolerance = CONTACT_TOLERANCE;
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        vi_contact *contact = &o->body.contacts[k];
        contact->side = VI_SIDE_UPPER;
        contact->law.restitution = 1.0;
        contact->law.exponent = 1.5;
        contact->last_time = contact->last_phase = contact->stick_start = contact->stick_end = NAN;
        contact->event_time = NAN;
    }
}

static void sized(void *self, const char *block, int count)
{
    if (strcmp(block, "contacts") == 0 && count >= 0 && count <= VI_BODY_CONTACTS) {
        ((oscillator *)self)->contacts_described = count;
    }
}

/* ---- validation: every problem is named, in one message ---- */

static void check_law(char *message, const vi_contact *contact, int n)
{
    const vi_contact_law *law = &contact->law;
    if (law->law == VI_LAW_EXTERNAL_FORCE) {
        return;
    }
    if (!vi_contact_law_is_compliant(law->law)) {
        if (!(law->restitution >= 0.0 && law->restitution <= 1.0)) {
            vi_complain(message, "contact[%d].restitution: expected 0 <= r <= 1, got %.17g", n, law->restitution);
        }
        if (!(law->yield_velocity >= 0.0) || !isfinite(law->yield_velocity)) {
            vi_complain(message, "contact[%d].yield_velocity: expected a finite number >= 0, got %.17g", n,
                        law->yield_velocity);
        }
        return;
    }
    if (!(law->stiffness > 0.0) || !isfinite(law->stiffness)) {
        vi_complain(message, "contact[%d].stiffness: expected a finite number > 0, got %.17g", n, law->stiffness);
    }
    if (!(law->damping >= 0.0) || !isfinite(law->damping)) {
        vi_complain(message, "contact[%d].damping: expected a finite number >= 0, got %.17g", n, law->damping);
    }
    if (law->law == VI_LAW_HUNT_CROSSLEY && (!(law->exponent >= 1.0) || !isfinite(law->exponent))) {
        vi_complain(message, "contact[%d].exponent: expected a finite number >= 1, got %.17g", n, law->exponent);
    }
    if (!(contact->relaxation_time >= 0.0) || !isfinite(contact->relaxation_time)) {
        vi_complain(message, "contact[%d].relaxation_time: expected a finite number >= 0, got %.17g", n,
                    contact->relaxation_time);
    }
}

static bool is_law(int64_t law)
{
    return vi_contact_law_known(law) || law == VI_LAW_EXTERNAL || law == VI_LAW_EXTERNAL_FORCE;
}

static void check_contact(char *message, const oscillator *o, int k)
{
    const vi_contact *contact = &o->body.contacts[k];
    const int n = k + 1;
    if (!vi_contact_law_has_stop(contact->law.law)) {
        return;
    }
    if (!is_law(contact->law.law)) {
        vi_complain(message,
                    "contact[%d].law: expected 0 (none), 1 (restitution), 2 (kelvin_voigt), 3 (hertz),"
                    " 4 (hunt_crossley), 5 (external), 6 (external_force) or 7 (pair), got %lld",
                    n, (long long)contact->law.law);
    }
    if (contact->side != VI_SIDE_UPPER && contact->side != VI_SIDE_LOWER) {
        vi_complain(message, "contact[%d].side: expected 1 (upper) or 2 (lower), got %lld", n,
                    (long long)contact->side);
    }
    check_law(message, contact, n);
    if (!isfinite(contact->position)) {
        vi_complain(message, "contact[%d].position: expected a finite number, got %.17g", n, contact->position);
        return;
    }
    const double sign = vi_contact_direction(contact->side);
    const bool rigid = !vi_contact_law_is_compliant(contact->law.law) && contact->law.law != VI_LAW_EXTERNAL_FORCE;
    if (rigid && sign * (o->displacement_start - contact->position) > 0.0) {
        vi_complain(message,
                    "displacement_start: expected a start on the free side of contact[%d] (%s %.17g), got %.17g", n,
                    sign > 0.0 ? "<=" : ">=", contact->position, o->displacement_start);
    }
}

/* Two stops on opposite sides must leave room to move. */
static void check_gap(char *message, const oscillator *o)
{
    const vi_contact *a = &o->body.contacts[0], *b = &o->body.contacts[1];
    if (!vi_contact_law_has_stop(a->law.law) || !vi_contact_law_has_stop(b->law.law) || a->side == b->side) {
        return;
    }
    const double sign = vi_contact_direction(a->side);
    if (!(sign * (a->position - b->position) > 0.0)) {
        vi_complain(message, "contact[2].position: expected room between the stops, got %.17g and %.17g", a->position,
                    b->position);
    }
}

static void check_inputs(char *message, const oscillator *o)
{
    vi_check_finite(message, "force", o->force);
    vi_check_finite(message, "force_rate", o->force_rate);
    vi_check_finite(message, "base_acceleration", o->base_acceleration);
    vi_check_finite(message, "base_acceleration_rate", o->base_acceleration_rate);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        const vi_contact *contact = &o->body.contacts[k];
        vi_check_finite(message, k == 0 ? "contact[1].applied_force" : "contact[2].applied_force",
                        contact->applied_force);
        vi_check_finite(message, k == 0 ? "contact[1].applied_stiffness" : "contact[2].applied_stiffness",
                        contact->applied_stiffness);
        vi_check_finite(message, k == 0 ? "contact[1].applied_damping" : "contact[2].applied_damping",
                        contact->applied_damping);
        vi_check_finite(message, k == 0 ? "contact[1].applied_impulse" : "contact[2].applied_impulse",
                        contact->applied_impulse);
    }
}

static bool parameters_are_good(const oscillator *o, char *message)
{
    vi_check_positive(message, "mass", o->mass);
    vi_check_not_negative(message, "damping", o->damping);
    vi_check_not_negative(message, "stiffness", o->stiffness);
    vi_check_finite(message, "amplitude.frequency_slope", o->amplitude.frequency_slope);
    vi_check_finite(message, "amplitude.damping_slope", o->amplitude.damping_slope);
    vi_check_not_negative(message, "amplitude.damping_reciprocal", o->amplitude.damping_reciprocal);
    if (vi_amplitude_acts(&o->amplitude) && o->stiffness == 0.0) {
        vi_complain(message, "amplitude: expected a stiffness > 0 beside it, got 0; without a spring there is no"
                             " natural frequency to change");
    }
    vi_check_finite(message, "forcing.amplitude", o->forcing_amplitude);
    vi_check_not_negative(message, "forcing.angular_frequency", o->forcing_angular_frequency);
    vi_check_finite(message, "forcing.phase", o->forcing_phase);
    vi_check_finite(message, "displacement_start", o->displacement_start);
    vi_check_finite(message, "velocity_start", o->velocity_start);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        check_contact(message, o, k);
    }
    if (oscillator_yields(o)) {
        vi_check_positive(message, "contact_tolerance", o->contact_tolerance);
    }
    check_gap(message, o);
    check_inputs(message, o);
    if (o->body.impact_limit < 0) {
        vi_complain(message, "impact_limit: expected >= 0, got %lld", (long long)o->body.impact_limit);
    }
    return message[0] == '\0';
}

/* ---- life ---- */

static void was_set(void *self, uint32_t value_reference)
{
    oscillator *o = self;
    if (value_reference == OSCILLATOR_RECORD_TAKEN) {
        vi_record_take(&o->body.record);
        return;
    }
    o->inputs_changed = 1;
    if (value_reference == OSCILLATOR_FORCING_AMPLITUDE || value_reference == OSCILLATOR_FORCING_ANGULAR_FREQUENCY) {
        o->forcing_changed = 1;
    }
    if (value_reference == OSCILLATOR_CONTACT_APPLIED_RESTITUTION_1) {
        o->body.contacts[0].answered = 1;
    } else if (value_reference == OSCILLATOR_CONTACT_APPLIED_RESTITUTION_2) {
        o->body.contacts[1].answered = 1;
    }
}

static void refresh_inputs(oscillator *o)
{
    oscillator_drive(o);
    if (o->inputs_changed) {
        oscillator_take_impulses(o);
        oscillator_hold(o);
    }
}

static void update_outputs(void *self)
{
    oscillator *o = self;
    refresh_inputs(o);
    o->time = vi_clock_time(&o->body.clock, oscillator_now(o));
    oscillator_outputs(o, &o->displacement, &o->velocity, &o->relative_acceleration);
    o->acceleration = o->relative_acceleration + o->base_acceleration;
    if (o->state.exchange.on) {
        const vi_exchange_body body = oscillator_exchange(o);
        vi_exchange_show_indicators(&body);
    }
    o->energy_kinetic = 0.5 * o->mass * o->velocity * o->velocity;
    o->energy_potential = 0.5 * o->stiffness * o->displacement * o->displacement;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    message[0] = '\0';
    if (!parameters_are_good(o, message)) {
        return false;
    }
    vi_instant now;
    if (!oscillator_start_clock(o, start_time, &now)) {
        vi_complain(message,
                    "forcing.angular_frequency: expected a period between 1e-300 and 1e300 s that a start time of"
                    " %.17g s can be counted in, got %.17g rad/s",
                    start_time, o->forcing_angular_frequency);
        return false;
    }
    o->forcing_changed = 0;
    oscillator_start(o, now);
    oscillator_hold(o);
    update_outputs(o);
    return true;
}

/* Of a tuned forcing that the body has not gone on with. */
static void check_drive(char *message, const oscillator *o)
{
    if (o->forcing_changed) {
        vi_check_finite(message, "forcing.amplitude", o->forcing_amplitude);
        vi_check_retuning(message, &o->body.clock, o->forcing_angular_frequency, oscillator_now(o));
    }
}

static bool step_is_good(const oscillator *o, const vi_step_request *request, vi_instant *target, char *message)
{
    message[0] = '\0';
    if (!(request->size > 0.0) || !isfinite(request->size)) {
        vi_complain(message, "communicationStepSize: expected a finite number > 0, got %.17g", request->size);
    }
    const double now = vi_clock_time(&o->body.clock, oscillator_now(o));
    if (!(fabs(request->time - now) <= TIME_MISMATCH * (1.0 + fabs(now)))) {
        vi_complain(message, "currentCommunicationPoint: expected %.17g (the end of the last step), got %.17g", now,
                    request->time);
    }
    const double high = request->time + request->size;
    const double part = high - request->time;
    const double low = (request->time - (high - part)) + (request->size - part);
    if (message[0] == '\0' && !vi_clock_instant(&o->body.clock, high, low, target)) {
        vi_complain(message, "currentCommunicationPoint: expected a time below 2^53 forcing periods, got %.17g", high);
    }
    check_inputs(message, o);
    check_drive(message, o);
    const int passed = oscillator_passed(o);
    if (passed) {
        vi_complain(message,
                    "contact[%d]: the last step passed through a stop whose law is external (event_time %.17g);"
                    " restore the state before it and step to event_time",
                    passed, o->body.contacts[passed - 1].event_time);
    }
    return message[0] == '\0';
}

/* Has every contact of this instant the answer that its law asks for? A force is one without being set: 0. */
static void check_answers(char *message, const oscillator *o)
{
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        const vi_contact *contact = &o->body.contacts[k];
        const double r = contact->applied_restitution;
        const bool asks = oscillator_asks(o, k) && contact->law.law == VI_LAW_EXTERNAL;
        if (asks && (!contact->answered || !(r >= 0.0 && r <= 1.0))) {
            vi_complain(message,
                        "contact[%d].applied_restitution: expected an answer 0 <= r <= 1 to the contact at %.17g s,"
                        " got %s%.17g",
                        k + 1, contact->event_time, contact->answered ? "" : "none; last value ", r);
        }
    }
}

static bool resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    message[0] = '\0';
    if (!oscillator_pending(o)) {
        return true;
    }
    check_answers(message, o);
    if (message[0] != '\0') {
        return false;
    }
    oscillator_resolve(o);
    update_outputs(o);
    return true;
}

static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    oscillator *o = self;
    vi_instant target;
    oscillator_drive(o);
    if (!step_is_good(o, request, &target, message) || !resolve(o, message)) {
        return VI_STEP_ERROR;
    }
    if (!oscillator_continues(o)) {
        oscillator_take_impulses(o);
        oscillator_follow_amplitude(o);
        oscillator_hold(o);
    }
    const vi_step_result result = oscillator_advance(o, target, request, message);
    update_outputs(o);
    return result;
}

static bool event_pending(const void *self)
{
    return oscillator_pending(self) != 0;
}

static bool needs_events(const void *self)
{
    const oscillator *o = self;
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        const int64_t law = o->body.contacts[k].law.law;
        if (law == VI_LAW_EXTERNAL || law == VI_LAW_EXTERNAL_FORCE) {
            return true;
        }
    }
    return false;
}

static double present_time(const void *self)
{
    const oscillator *o = self;
    return vi_clock_time(&o->body.clock, oscillator_now(o));
}

static size_t used_size(const void *self)
{
    const oscillator *o = self;
    return sizeof *o - sizeof o->pressed - vi_record_unused(&o->body.record);
}

VI_EXCHANGE_TABLE(exchange, oscillator_exchange, refresh_inputs);

const vi_component vi_this_component = {
    .name = OSCILLATOR_NAME,
    .token = OSCILLATOR_TOKEN,
    .variables = oscillator_variables,
    .variable_count = OSCILLATOR_VARIABLE_COUNT,
    .struct_size = sizeof(oscillator),
    .defaults = defaults,
    .initialize = initialize,
    .was_set = was_set,
    .update_outputs = update_outputs,
    .step = step,
    .resolve = resolve,
    .event_pending = event_pending,
    .needs_events = needs_events,
    .time = present_time,
    .used_size = used_size,
    .sized = sized,
    .exchange = &exchange,
};
