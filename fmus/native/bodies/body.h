/* The common part of Oscillator, Chain, Beam and Structure as components: stops and record, initialization, steps and energies.
 * Such a component has its parameters, a vi_body at the end of its struct, and a table of its own functions,
 * `vi_this_body`, from which body.c makes `vi_this_component`. */
#ifndef VIBROIMPACT_BODY_H
#define VIBROIMPACT_BODY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "body/modal/loads.h"
#include "body/modal/modal_scan.h"
#include "body/modal/power_tables.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/exchange.h"
#include "body/modal/structure/structure.h"
#include "body_sensitivities.h"
#include "body_strobe.h"
#include "component.h"

struct vi_body {
    /* parameters; impact_limit is in `model`, the contacts' are in `contacts` */
    double contact_tolerance;
    double forcing_angular_frequency, forcing_phase;
    /* inputs */
    double base_acceleration, base_acceleration_rate;
    int32_t record_energies;
    int32_t inputs_changed; /* an input was set since the engine got the inputs */
    int32_t forcing_changed; /* a tunable parameter was set since, of the forcing or of a stop's motion */
    int32_t stop_refused;    /* 0, or the contact (1-based) whose stop may not take its new place */
    /* outputs */
    double displacement, velocity, acceleration; /* of the observed point; absolute acceleration */
    double energy_kinetic, energy_potential;
    double natural[VI_MODES], modal_energy[VI_MODES];
    double modal_acceleration[VI_MODES]; /* kg^(1/2) m/s^2 */
    int64_t contacts_used;      /* number of ports that may have a law */
    int32_t contacts_described; /* number of ports in the model description */
    int32_t external_hidden; /* the model description lacks the laws that another component answers */
    vi_strobe strobe;
    vi_structure_model model;
    vi_structure_state state;
    vi_contact contacts[VI_PORTS];
    uint64_t signals_key; /* hash of the signals' parameters, 0: there are none */
    vi_record record;   /* saved only as far as it is used */
    vi_sensitivities sensitive; /* `sensitive` and `followed` are saved only where there are any */
    vi_followed followed;
    vi_pressed_cache pressed; /* `pressed`, `scan`, `power` and `signals` are caches */
    vi_scan scan;
    vi_power_tables power;
    vi_signal_loads signals;
};

/* The functions and references of one component; `self` is its struct. */
typedef struct {
    size_t place;         /* offset of its vi_body, the last member, bytes */
    uint32_t restitution; /* reference of contact[1].applied_restitution */
    uint32_t stride;      /* distance of references between two contacts */
    uint32_t taken;       /* reference of record.taken */
    const char *start;    /* name of the variable with its start displacement */

    /* Fill `self` (zeroed) with the component's own default values. */
    void (*defaults)(void *self);
    /* The model description has `count` of the repeated variables `block`; NULL: the component always has one mode. */
    void (*sized)(void *self, const char *block, int count);
    /* Read further resources, as `vi_component` has it; all three are NULL for a body without. */
    void *(*open)(const char *folder, char message[VI_MESSAGE_LENGTH]);
    void (*attach)(void *self, const void *resources);
    void (*close)(void *resources);
    /* Check the parameters, also with vi_body_check; set modes, shapes and impulses of `model`, and the modal start in
     * `state`. Returns false after complaining. */
    bool (*prepare)(void *self, char message[VI_MESSAGE_LENGTH]);
    /* Warn of a body that has started but is not valid throughout; NULL: no warnings. */
    void (*warn)(const void *self, char message[VI_MESSAGE_LENGTH]);
    /* Complain of the component's own inputs; of its own parameters of the forcing. */
    void (*check_inputs)(const void *self, char message[VI_MESSAGE_LENGTH]);
    void (*check_forcing)(const void *self, char message[VI_MESSAGE_LENGTH]);
    /* Amplitudes of the forcing's modal forces; a force of frequency 0 is constant. */
    void (*find_forcing)(const void *self, double force[VI_MODES]);
    /* Put the further sines on the modes: at the start, or tuned ones, whose phases go on. NULL: there are none. */
    void (*drive_further)(void *self, bool at_start);
    /* Make the signals of time from their parameters; NULL: there are none. */
    void (*make_signals)(void *self, vi_signal_loads *signals);
    /* Motions of the stops; their tables. Both are NULL for a body whose stops stand still. */
    void (*find_stops)(const void *self, vi_stop_motion motion[VI_PORTS]);
    vi_table (*tables)(const void *self);
    /* Modal forces of the inputs, and their slopes. */
    void (*find_inputs)(const void *self, double held[VI_MODES], double held_rate[VI_MODES]);
    /* Adapt the modes to the present amplitudes, until the next step; NULL: modes do not depend on amplitudes. */
    void (*follow_amplitudes)(void *self);
    /* Amplitude of the base's acceleration by the forcing, m/s^2. */
    double (*base_forcing)(const void *self);
    /* Present acceleration of the base by further forces, m/s^2; NULL: there are none. */
    double (*base_further)(const void *self, const vi_phase further[], const double signal_value[]);
    /* Compute the component's own outputs from the absolute acceleration of the base, m/s^2. */
    void (*update_outputs)(void *self, double base_acceleration);
    /* Describe its states in the model description. */
    void (*show_states)(void *self, vi_exchange_body *body);
    /* Partial derivatives over a known, or of an unknown, of the component's own, at this offset in `self`; `line` is
     * zeroed. False: it is none. The base's acceleration is a known of the component for its loads alone. */
    bool (*column)(void *self, size_t offset, vi_line *line);
    bool (*row)(void *self, size_t offset, vi_line *line);
    /* Set the slopes of the equations, and of the start in `of`, over a parameter of the component's own at this offset.
     * Both are zeroed. False: the component has no derivative over it. */
    bool (*parameter)(void *self, size_t offset, vi_parameter *parameter, vi_sensitivity *of);
} vi_body_form;

/* The body of the only component in this shared library. */
extern const vi_body_form vi_this_body;

vi_body *vi_body_of(void *self);

/* The engine's view of the parts. */
vi_structure vi_body_parts(vi_body *c);

/* Complain of parameters of all bodies: frequency and phase of the forcing, contact laws, tolerance, limit, inputs. */
void vi_body_check(const vi_body *c, char message[VI_MESSAGE_LENGTH]);

/* Number of ports in use: up to the last port with a law. */
int vi_body_ports(const vi_body *c);

/* cos of the force's present phase, or of forcing_phase for a constant force. */
double vi_body_cosine_of_forcing(const vi_body *c);

/* A line over the modes in use: the displacement of a point of this shape, or of mode j times `shape` (result: true). */
void vi_body_line_of_shape(const vi_body *c, vi_line *line, const double shape[]);
bool vi_body_line_of_mode(const vi_body *c, vi_line *line, int j, double shape);

/* The variable is element `first` of an array of VI_MODES alike ones, `used` of which depend on anything: of all modes. */
void vi_body_line_is_alike(vi_line *line, int first, int used);
bool vi_body_line_of_modes(const vi_body *c, vi_line *line, int j, double shape);

/* Is there an element of the array of doubles at `place` at this offset? Then *index is its index. */
static inline bool vi_body_is_element(size_t offset, size_t place, size_t size, int *index)
{
    *index = (int)((offset - place) / sizeof(double)); /* a large offset for places before the array */
    return offset - place < size;
}

/* Give the engine the inputs that were set, and a tuned forcing if the body can go on with it. */
void vi_body_refresh_inputs(void *self);

#endif
