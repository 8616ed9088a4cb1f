#include "body.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "body/law_check.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/impact.h"

/* An importer's communication point may differ from the body's own time by this times (1 + |time|), s. */
static const double TIME_MISMATCH = 1e-9;
static const double DEFAULT_TOLERANCE = 1e-10;
static const double LOOSEST_TOLERANCE = 1e-2;

void vi_body_defaults(vi_body *c)
{
    c->contact_tolerance = DEFAULT_TOLERANCE;
    c->contacts_described = VI_PORTS;
    for (int k = 0; k < VI_PORTS; ++k) {
        c->contacts[k].side = VI_SIDE_UPPER;
        c->contacts[k].law.restitution = 1.0;
        c->contacts[k].law.exponent = 1.5;
        vi_contact_clear(&c->contacts[k]);
    }
}

/* The engine's view of the parts. */
static vi_structure parts_of(vi_body *c)
{
    return (vi_structure){&c->model, &c->state, c->contacts, &c->record, &c->pressed, &c->scan};
}

void vi_body_sized(vi_body *c, const char *block, int count)
{
    if (strcmp(block, "contacts") == 0 && count >= 0 && count <= VI_PORTS) {
        c->contacts_described = count;
    }
    if (strcmp(block, "external_laws") == 0) {
        c->external_hidden = count == 0;
    }
}

vi_exchange_body vi_body_exchange(vi_body *c)
{
    return (vi_exchange_body){.parts = parts_of(c),
                              .contacts = c->contacts_described,
                              .scale = 1.0,
                              .refused = c->record_energies ? "record.energies" : NULL};
}

/* ---- validation ---- */

typedef struct {
    char text[48];
} port_name;

static port_name name_of(int k, const char *variable)
{
    port_name name;
    (void)snprintf(name.text, sizeof name.text, "contact[%d].%s", k + 1, variable);
    return name;
}

static bool is_inside(int64_t law)
{
    return vi_contact_law_exists(law) && !vi_contact_law_is_external(law);
}

static void check_contact(char *message, int k, const vi_contact *contact, bool external_hidden)
{
    const vi_contact_law *law = &contact->law;
    const port_name port = name_of(k, "");
    if (!vi_contact_law_exists(law->law)) {
        vi_complain_of_law(message, name_of(k, "law").text, "", external_hidden ? is_inside : vi_contact_law_exists,
                           law->law);
    }
    if (contact->side != VI_SIDE_UPPER && contact->side != VI_SIDE_LOWER) {
        vi_complain(message, "contact[%d].side: expected 1 (upper) or 2 (lower), got %lld", k + 1,
                    (long long)contact->side);
    }
    vi_check_finite(message, name_of(k, "position").text, contact->position);
    vi_check_law_rules(message, port.text, law, vi_impact_rules);
    vi_check_not_negative(message, name_of(k, "relaxation_time").text, contact->relaxation_time);
    if (vi_contact_law_yields(law->law)) {
        vi_check_law_rules(message, port.text, law, vi_law_of(law->law)->rules);
    }
}

/* The name is written only where it is needed: inputs are checked in every step. */
static void check_port_input(char *message, int k, const char *variable, double value)
{
    if (!isfinite(value)) {
        vi_check_finite(message, name_of(k, variable).text, value);
    }
}

static void check_inputs(const vi_body *c, char *message)
{
    vi_check_finite(message, "base_acceleration", c->base_acceleration);
    vi_check_finite(message, "base_acceleration_rate", c->base_acceleration_rate);
    for (int k = 0; k < VI_PORTS; ++k) {
        check_port_input(message, k, "applied_force", c->contacts[k].applied_force);
        check_port_input(message, k, "applied_stiffness", c->contacts[k].applied_stiffness);
        check_port_input(message, k, "applied_damping", c->contacts[k].applied_damping);
        check_port_input(message, k, "applied_impulse", c->contacts[k].applied_impulse);
    }
}

void vi_body_check(const vi_body *c, char message[VI_MESSAGE_LENGTH])
{
    vi_check_not_negative(message, "forcing.angular_frequency", c->forcing_angular_frequency);
    vi_check_finite(message, "forcing.phase", c->forcing_phase);
    for (int k = 0; k < VI_PORTS; ++k) {
        if (!vi_contact_law_is_none(c->contacts[k].law.law)) {
            check_contact(message, k, &c->contacts[k], c->external_hidden);
        }
    }
    if (!(c->contact_tolerance > 0.0 && c->contact_tolerance <= LOOSEST_TOLERANCE)) {
        vi_complain(message, "contact_tolerance: expected 0 < tolerance <= %g, got %.17g", LOOSEST_TOLERANCE,
                    c->contact_tolerance);
    }
    if (c->model.impact_limit < 0) {
        vi_complain(message, "impact_limit: expected >= 0, got %lld", (long long)c->model.impact_limit);
    }
    check_inputs(c, message);
}

int vi_body_ports(const vi_body *c)
{
    int ports = VI_PORTS;
    while (ports > 0 && vi_contact_law_is_none(c->contacts[ports - 1].law.law)) {
        --ports;
    }
    return ports;
}

static bool at_one_point(const vi_structure_model *model, int i, int j)
{
    return memcmp(model->shape[i], model->shape[j], (size_t)vi_structure_modes(model) * sizeof(double)) == 0;
}

/* Does the body meet stop i first, for good? A rigid one is never passed. */
static bool hides(const vi_contact *i, const vi_contact *j)
{
    return vi_contact_law_is_rigid(i->law.law)
           && vi_contact_direction(i->side) * (j->position - i->position) >= 0.0;
}

static void check_pair(const vi_contact contacts[], int i, int j, char *message)
{
    const vi_contact *a = &contacts[i], *b = &contacts[j];
    if (a->side != b->side) {
        if (!(vi_contact_direction(a->side) * (a->position - b->position) > 0.0)) {
            vi_complain(message, "contact[%d].position: expected room between it and contact[%d] on the other side of"
                                 " the same point, got %.17g and %.17g", j + 1, i + 1, b->position, a->position);
        }
    } else if (hides(a, b) || hides(b, a)) {
        const int front = hides(a, b) ? i : j, behind = front == i ? j : i;
        vi_complain(message, "contact[%d].position: expected a position that the rigid contact[%d] (%.17g) on the same"
                             " side of the same point does not hide, got %.17g", behind + 1, front + 1,
                    contacts[front].position, contacts[behind].position);
    }
}

/* Contacts i and j are at the same point of the body when their shapes are equal. Complain where such stops leave no
 * room, or where a rigid one hides the one behind it. */
static void check_points(const vi_body *c, char message[VI_MESSAGE_LENGTH])
{
    for (int j = 1; j < c->model.contacts; ++j) {
        for (int i = 0; i < j; ++i) {
            const bool both = vi_contact_law_has_stop(c->contacts[i].law.law)
                              && vi_contact_law_has_stop(c->contacts[j].law.law);
            if (both && at_one_point(&c->model, i, j)) {
                check_pair(c->contacts, i, j, message);
            }
        }
    }
}

/* ---- life ---- */

static double lowest_natural(const vi_body *c)
{
    for (int j = 0; j < c->model.modes; ++j) {
        if (c->natural[j] > 0.0) {
            return c->natural[j];
        }
    }
    return 0.0;
}

static bool start_clock(vi_body *c, double start_time, vi_instant *now, char *message)
{
    vi_clock *clock = &c->model.clock;
    if (vi_clock_start(clock, c->forcing_angular_frequency, c->forcing_phase, lowest_natural(c))
        && isfinite(start_time) && vi_clock_instant(clock, start_time, 0.0, now)) {
        return true;
    }
    vi_complain(message, "forcing.angular_frequency: expected a period between 1e-300 and 1e300 s that a start time of"
                         " %.17g s can be counted in, got %.17g rad/s", start_time, c->forcing_angular_frequency);
    return false;
}

static bool starts_free(vi_body *c, const char *start_name, char *message)
{
    const vi_structure parts = parts_of(c);
    const int beyond = vi_structure_beyond(&parts);
    if (beyond == 0) {
        return true;
    }
    const vi_contact *contact = &c->contacts[beyond - 1];
    vi_complain(message, "%s: expected a start on the free side of contact[%d] (%s %.17g), got %.17g there", start_name,
                beyond, contact->side == VI_SIDE_UPPER ? "<=" : ">=", contact->position,
                vi_structure_at(&c->model, c->model.shape[beyond - 1], c->state.q));
    return false;
}

bool vi_body_start(vi_body *c, double start_time, const char *start_name,
                                  char message[VI_MESSAGE_LENGTH])
{
    for (int k = 0; k < VI_PORTS; ++k) {
        vi_contact_clear(&c->contacts[k]);
    }
    memset(c->state.status, 0, sizeof c->state.status); /* of a start with other start values */
    c->forcing_changed = 0;
    c->model.tolerance = c->contact_tolerance;
    vi_structure_prepare(&c->model);
    check_points(c, message);
    vi_instant now;
    if (!start_clock(c, start_time, &now, message) || !starts_free(c, start_name, message) || message[0] != '\0') {
        return false;
    }
    const vi_structure parts = parts_of(c);
    vi_structure_start(&parts, now);
    return true;
}

void vi_body_take_impulses(vi_body *c)
{
    const vi_structure parts = parts_of(c);
    vi_structure_take_impulses(&parts);
}

void vi_body_drive(vi_body *c, const double force[VI_MODES])
{
    bool good = vi_clock_can_retune(&c->model.clock, c->forcing_angular_frequency, c->state.now);
    for (int j = 0; j < c->model.modes; ++j) {
        good = good && isfinite(force[j]);
    }
    if (good) {
        const vi_structure parts = parts_of(c);
        vi_structure_drive(&parts, force, c->forcing_angular_frequency);
        c->forcing_changed = 0;
    }
}

void vi_body_check_drive(const vi_body *c, char message[VI_MESSAGE_LENGTH])
{
    if (c->forcing_changed) {
        vi_check_retuning(message, &c->model.clock, c->forcing_angular_frequency, c->state.now);
    }
}

void vi_body_hold(vi_body *c, const double held[VI_MODES],
                                 const double held_rate[VI_MODES])
{
    const vi_structure parts = parts_of(c);
    vi_structure_hold(&parts, held, held_rate);
    vi_structure_meet_forces(&parts);
    c->inputs_changed = 0;
}

bool vi_body_continues(const vi_body *c)
{
    return c->state.budget.unfinished && !c->inputs_changed;
}

void vi_body_was_set(vi_body *c, uint32_t reference, uint32_t restitution,
                                    uint32_t stride, uint32_t taken)
{
    const uint32_t from_first = reference - restitution; /* wraps to a large number below the first */
    if (reference == taken) {
        vi_record_take(&c->record);
        return;
    }
    c->inputs_changed = 1;
    vi_record_switched(&c->record);
    if (from_first % stride == 0 && from_first / stride < VI_PORTS) {
        c->contacts[from_first / stride].answered = 1;
    }
}

/* ---- outputs ---- */

double vi_body_time(const vi_body *c)
{
    return vi_clock_time(&c->model.clock, c->state.now);
}

/* cos of the force's phase at the present instant; of forcing_phase when it is constant. */
static double cosine_of_forcing(const vi_body *c)
{
    const double w = c->model.clock.angular_frequency;
    return w > 0.0 ? cos(w * c->state.now.rest) : cos(c->forcing_phase);
}

double vi_body_base_acceleration(const vi_body *c, double amplitude)
{
    const double since = vi_clock_elapsed(&c->model.clock, c->state.held_since, c->state.now);
    const double input = c->base_acceleration + (c->state.exchange.on ? 0.0 : c->base_acceleration_rate * since);
    return amplitude == 0.0 ? input : input + amplitude * cosine_of_forcing(c);
}

static void update_energies(vi_body *c)
{
    c->energy_kinetic = c->energy_potential = 0.0;
    for (int j = 0; j < c->model.modes; ++j) {
        const double p = c->state.p[j], stretch = c->natural[j] * c->state.q[j];
        c->energy_kinetic += 0.5 * p * p;
        c->energy_potential += 0.5 * stretch * stretch;
        c->modal_energy[j] = c->record_energies ? 0.5 * (p * p + stretch * stretch) : 0.0;
    }
}

void vi_body_outputs(vi_body *c, double base_acceleration)
{
    const vi_structure parts = parts_of(c);
    vi_structure_outputs(&parts, c->modal_acceleration);
    c->displacement = vi_structure_observed(&parts);
    c->velocity = vi_structure_at(&c->model, c->model.observed, c->state.p);
    c->acceleration = vi_structure_at(&c->model, c->model.observed, c->modal_acceleration) + base_acceleration;
    update_energies(c);
}

/* ---- steps ---- */

static void check_passed(const vi_body *c, char *message)
{
    const int passed = c->state.passed;
    if (passed) {
        vi_complain(message, "contact[%d]: the last step passed through a stop whose law is external (event_time"
                             " %.17g); restore the state before it and step to event_time", passed,
                    c->contacts[passed - 1].event_time);
    }
}

bool vi_body_step_is_good(const vi_body *c, const vi_step_request *request,
                                         vi_instant *target, char message[VI_MESSAGE_LENGTH])
{
    if (!(request->size > 0.0) || !isfinite(request->size)) {
        vi_complain(message, "communicationStepSize: expected a finite number > 0, got %.17g", request->size);
    }
    const double now = vi_body_time(c);
    if (!(fabs(request->time - now) <= TIME_MISMATCH * (1.0 + fabs(now)))) {
        vi_complain(message, "currentCommunicationPoint: expected %.17g (the end of the last step), got %.17g", now,
                    request->time);
    }
    /* the end of the step with its rounding, so that steps of 1e-9 s at 1e6 s are no shorter or longer */
    const double high = request->time + request->size;
    const double part = high - request->time;
    const double low = (request->time - (high - part)) + (request->size - part);
    if (message[0] == '\0' && !vi_clock_instant(&c->model.clock, high, low, target)) {
        vi_complain(message, "currentCommunicationPoint: expected a time below 2^53 periods, got %.17g", high);
    }
    check_inputs(c, message);
    check_passed(c, message);
    return message[0] == '\0';
}

/* A stop that answers with a force has answered once its importer goes on: the force follows by the inputs. */
static void check_answer(const vi_body *c, int k, char *message)
{
    const vi_contact *contact = &c->contacts[k];
    const double r = contact->applied_restitution;
    if (vi_contact_law_is_rigid(contact->law.law) && !(contact->answered && r >= 0.0 && r <= 1.0)) {
        vi_complain(message, "contact[%d].applied_restitution: expected an answer 0 <= r <= 1 to the contact at"
                             " %.17g s, got %s%.17g", k + 1, contact->event_time,
                    contact->answered ? "" : "none; last value ", r);
    }
}

bool vi_body_resolve(vi_body *c, char message[VI_MESSAGE_LENGTH])
{
    if (!c->state.pending) {
        return true;
    }
    for (int k = 0; k < c->model.contacts; ++k) {
        if (c->state.asking[k]) { /* several at one instant wait for their answers together */
            check_answer(c, k, message);
        }
    }
    if (message[0] != '\0') {
        return false;
    }
    const vi_structure parts = parts_of(c);
    vi_structure_resolve(&parts);
    return true;
}

vi_step_result vi_body_advance(vi_body *c, vi_instant target,
                                              const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    const vi_structure parts = parts_of(c);
    c->state.follow_energies = c->record_energies;
    const vi_step_result result = vi_structure_advance(&parts, target, request);
    if (result == VI_STEP_STANDSTILL) {
        vi_structure_complain(&parts, message);
    }
    vi_complain_of_end(message, result, vi_body_time(c));
    return result;
}

bool vi_body_needs_events(const vi_body *c)
{
    for (int k = 0; k < VI_PORTS; ++k) {
        if (vi_contact_law_asks(c->contacts[k].law.law)) {
            return true;
        }
    }
    return false;
}

size_t vi_body_unused(const vi_body *c)
{
    return vi_record_unused(&c->record) + sizeof c->pressed + sizeof c->scan;
}
