/* What the components of N modes (Chain, Beam) share: their stops and record, the checks, the words of their
 * complaints, steps, energies. A component is its parameters, the modes that follow from them, and this.
 *
 * Life: `defaults`; then at initialization the component checks its own parameters and `..._check`, fills `model` with
 * modes and shapes, sets the modal start state, and calls `..._start`; then `..._hold` whenever inputs were set.
 */
#ifndef VIBROIMPACT_BODY_H
#define VIBROIMPACT_BODY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "body/complaint.h"
#include "body/modal/modal_scan.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/exchange.h"
#include "body/modal/structure/structure.h"

typedef struct {
    /* parameters; impact_limit and the contacts' are in `model` and `contacts` */
    double contact_tolerance;
    double forcing_angular_frequency, forcing_phase;
    /* inputs */
    double base_acceleration, base_acceleration_rate;
    int32_t record_energies;
    int32_t inputs_changed; /* since they were last given to the engine */
    int32_t forcing_changed; /* likewise the tunable parameters of the forcing */
    /* outputs */
    double displacement, velocity, acceleration; /* of the observed point, acceleration absolute */
    double energy_kinetic, energy_potential;
    double natural[VI_MODES], modal_energy[VI_MODES];
    double modal_acceleration[VI_MODES]; /* kg^(1/2) m/s^2 */
    int32_t contacts_described; /* ports of the model description */
    int32_t external_hidden; /* the model description does not name the laws that another component answers */
    vi_structure_model model;
    vi_structure_state state;
    vi_contact contacts[VI_PORTS];
    vi_record record;   /* it is saved only as far as it is used, and nothing after it */
    vi_pressed pressed; /* this and `scan` follow from the rest */
    vi_scan scan;
} vi_body;

void vi_body_defaults(vi_body *c);

/* Parameters that all have: forcing's frequency and phase, the contacts' laws, tolerance, limit, shared inputs. */
void vi_body_check(const vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* The model description has so many ports, or (`external_laws`, 0) no law that another component answers. */
void vi_body_sized(vi_body *c, const char *block, int count);

/* Number of ports that have to be followed: up to the last one with a law. */
int vi_body_ports(const vi_body *c);

/* Modes, shapes, impulses, q, p are set: derive the rest, refuse a start beyond a stop (in the words `start_name`),
 * begin at `start_time`. */
bool vi_body_start(vi_body *c, double start_time, const char *start_name,
                                  char message[VI_MESSAGE_LENGTH]);

/* Give the body the impulses of its contacts, once; before new forces. */
void vi_body_take_impulses(vi_body *c);

/* The forcing was tuned, and this is what it is for the modes: go on with it, where it is one that the body can go on with. */
void vi_body_drive(vi_body *c, const double force[VI_MODES]);

/* Complain of a tuned forcing that the body cannot go on with. */
void vi_body_check_drive(const vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* Give the engine new modal input forces (from now on, with slopes). */
void vi_body_hold(vi_body *c, const double held[VI_MODES],
                                 const double held_rate[VI_MODES]);

/* Acceleration of the base at the present instant, m/s^2: the input, and the forcing of this amplitude (m/s^2). */
double vi_body_base_acceleration(const vi_body *c, double amplitude);

/* Recompute what is shared of the outputs. `base_acceleration`: absolute acceleration of the base, m/s^2. */
void vi_body_outputs(vi_body *c, double base_acceleration);

/* Is the step one that can be made? Complains otherwise. */
bool vi_body_step_is_good(const vi_body *c, const vi_step_request *request,
                                         vi_instant *target, char message[VI_MESSAGE_LENGTH]);

/* Resolve what is pending; false when the answer is missing or bad. */
bool vi_body_resolve(vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* Complains where the step is given up. */
vi_step_result vi_body_advance(vi_body *c, vi_instant target,
                                              const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);

/* Is the next step the rest of one that ended early for no reason of the motion, under the same inputs? Their slopes, and
 * what is found at the start of a step, then hold on. */
bool vi_body_continues(const vi_body *c);

/* A variable was set; `restitution` is the reference of contact[1].applied_restitution, `stride` the distance to that
 * of the next contact, `taken` the reference of record.taken. */
void vi_body_was_set(vi_body *c, uint32_t reference, uint32_t restitution,
                                    uint32_t stride, uint32_t taken);

/* The body as an importer integrates it, but for the form of its states. */
vi_exchange_body vi_body_exchange(vi_body *c);

bool vi_body_needs_events(const vi_body *c);
double vi_body_time(const vi_body *c);

/* Bytes at the end of the component that need not be saved. */
size_t vi_body_unused(const vi_body *c);

#endif
