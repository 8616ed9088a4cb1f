#include "body_check.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "body/law_check.h"

/* Largest difference of an importer's communication point from the body's own time, s, in units of 1 + |time|. */
static const double TIME_MISMATCH = 1e-9;
static const double LOOSEST_TOLERANCE = 1e-2; /* largest valid contact_tolerance */

/* ---- parameters and inputs ---- */

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

/* Names are written only for a complaint, since inputs are checked in every step. */
static void check_port_input(char *message, int k, const char *variable, double value)
{
    if (!isfinite(value)) {
        vi_check_finite(message, name_of(k, variable).text, value);
    }
}

void vi_body_check_inputs(const vi_body *c, char message[VI_MESSAGE_LENGTH])
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

bool vi_body_use_contacts(vi_body *c, char message[VI_MESSAGE_LENGTH])
{
    if (c->contacts_used < 0 || c->contacts_used > c->contacts_described) {
        vi_complain(message, "contacts: expected 0 to %d, got %lld", c->contacts_described, (long long)c->contacts_used);
        return false;
    }
    for (int64_t k = c->contacts_used; k < VI_PORTS; ++k) {
        vi_contact_law_clear(&c->contacts[k].law);
    }
    return true;
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
    vi_body_check_inputs(c, message);
}

static bool at_one_point(const vi_structure_model *model, int i, int j)
{
    return memcmp(model->shape[i], model->shape[j], (size_t)vi_structure_modes(model) * sizeof(double)) == 0;
}

/* Does the body always meet stop i before stop j? A rigid stop is never passed. */
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

/* Contacts i and j are at the same point of the body if their shapes are equal. */
void vi_body_check_points(const vi_body *c, char message[VI_MESSAGE_LENGTH])
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

bool vi_body_check_step(const vi_body *c, const vi_step_request *request, vi_instant *target,
                        char message[VI_MESSAGE_LENGTH])
{
    if (!(request->size > 0.0) || !isfinite(request->size)) {
        vi_complain(message, "communicationStepSize: expected a finite number > 0, got %.17g", request->size);
    }
    const double now = vi_clock_time(&c->model.clock, c->state.now);
    if (!(fabs(request->time - now) <= TIME_MISMATCH * (1.0 + fabs(now)))) {
        vi_complain(message, "currentCommunicationPoint: expected %.17g (the end of the last step), got %.17g", now,
                    request->time);
    }
    /* the end of the step with its rounding, so that steps of 1e-9 s at 1e6 s keep their length */
    const double high = request->time + request->size;
    const double part = high - request->time;
    const double low = (request->time - (high - part)) + (request->size - part);
    if (message[0] == '\0' && !vi_clock_instant(&c->model.clock, high, low, target)) {
        vi_complain(message, "currentCommunicationPoint: expected a time below 2^53 periods, got %.17g", high);
    }
    vi_body_check_inputs(c, message);
    check_passed(c, message);
    return message[0] == '\0';
}

/* Check the answer of a rigid stop. A force needs no answer: it is an input, there once the importer goes on. */
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

bool vi_body_check_answers(const vi_body *c, char message[VI_MESSAGE_LENGTH])
{
    for (int k = 0; k < c->model.contacts; ++k) {
        if (c->state.asking[k]) { /* contacts at one instant wait for their answers together */
            check_answer(c, k, message);
        }
    }
    return message[0] == '\0';
}
