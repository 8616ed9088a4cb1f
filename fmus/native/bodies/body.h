/* What the Oscillator, the Chain and the Beam share as components: their stops and record, their life, steps and energies.
 * Such a component is its parameters, this at the end of its struct, and a table of what differs, `vi_this_body`; body.c makes
 * `vi_this_component` of it. */
#ifndef VIBROIMPACT_BODY_H
#define VIBROIMPACT_BODY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "body/modal/modal_scan.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/exchange.h"
#include "body/modal/structure/structure.h"
#include "component.h"

typedef struct {
    /* parameters; impact_limit and the contacts' are in `model` and `contacts` */
    double contact_tolerance;
    double forcing_angular_frequency, forcing_phase;
    /* inputs */
    double base_acceleration, base_acceleration_rate;
    int32_t record_energies;
    int32_t inputs_changed; /* since they were last given to the engine */
    int32_t forcing_changed; /* likewise the tunable parameters, all of the forcing */
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

/* What a component adds; `self` is its struct. */
typedef struct {
    size_t place;         /* offset of its vi_body, bytes; the last member */
    uint32_t restitution; /* reference of contact[1].applied_restitution */
    uint32_t stride;      /* from there to that of the next contact */
    uint32_t taken;       /* reference of record.taken */
    const char *start;    /* name of the variable that says where it starts */

    /* Fill `self` (zeroed) with its own default values. */
    void (*defaults)(void *self);
    /* The model description has `count` of the repeated variables `block`; NULL: it has one mode, always. */
    void (*sized)(void *self, const char *block, int count);
    /* Check its parameters, with vi_body_check among the checks; set modes, shapes and impulses of `model`, and the modal start
     * in `state`. False after complaining. */
    bool (*prepare)(void *self, char message[VI_MESSAGE_LENGTH]);
    /* Say what a body that has started leaves to doubt; NULL: nothing. */
    void (*warn)(const void *self, char message[VI_MESSAGE_LENGTH]);
    /* Complain of its own inputs; of its own parameters of the forcing. */
    void (*check_inputs)(const void *self, char message[VI_MESSAGE_LENGTH]);
    void (*check_forcing)(const void *self, char message[VI_MESSAGE_LENGTH]);
    /* Amplitudes of the modal forces of the forcing; a force of frequency 0 is constant. */
    void (*find_forcing)(const void *self, double force[VI_MODES]);
    /* Modal forces of the inputs, and their slopes. */
    void (*find_inputs)(const void *self, double held[VI_MODES], double held_rate[VI_MODES]);
    /* Modes as they are at the present amplitudes, until the next step. NULL: they do not depend on them. */
    void (*follow_amplitudes)(void *self);
    /* Amplitude of the base's acceleration by the forcing, m/s^2. */
    double (*base_forcing)(const void *self);
    /* Compute its own outputs; absolute acceleration of the base, m/s^2. */
    void (*update_outputs)(void *self, double base_acceleration);
    /* How its model description shows it: the form of its states. */
    void (*show_states)(void *self, vi_exchange_body *body);
} vi_body_form;

/* The body of the one component that this shared library holds. */
extern const vi_body_form vi_this_body;

vi_body *vi_body_of(void *self);

/* The engine's view of the parts. */
vi_structure vi_body_parts(vi_body *c);

/* Complain of the parameters that all have: forcing's frequency and phase, the contacts' laws, tolerance, limit, shared inputs. */
void vi_body_check(const vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* Number of ports that have to be followed: up to the last one with a law. */
int vi_body_ports(const vi_body *c);

/* Give the engine the inputs that were set, and the forcing that was tuned where the body can go on with it. */
void vi_body_refresh_inputs(void *self);

#endif
