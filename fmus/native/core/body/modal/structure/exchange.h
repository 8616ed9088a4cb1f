/* A body of N modes that the importer integrates: model exchange.
 *
 * States are the displacements, then the velocities, of the modes or of the masses. The status of each contact changes
 * only in vi_exchange_event, so that derivatives and indicators are smooth between events. A contact's indicator is > 0
 * as long as nothing happens.
 */
#ifndef VIBROIMPACT_STRUCTURE_EXCHANGE_H
#define VIBROIMPACT_STRUCTURE_EXCHANGE_H

#include <stdbool.h>
#include <stddef.h>

#include "body/complaint.h"
#include "body/modal/state.h"

/* A body, and its states in the model description. */
typedef struct {
    vi_structure parts;
    int modes, contacts;  /* of the description; those beyond the body's own stand still */
    double scale;         /* modal displacement for a state of 1 m, kg^(1/2); used when the states are modal */
    /* for states of masses: displacements of the masses for modal ones, and the masses; otherwise NULL */
    const double (*shape)[VI_MODES];
    const double *mass;
    const char *refused;  /* the component's own parameters that cannot be integrated, or NULL */
} vi_exchange_body;

void vi_exchange_enable(const vi_exchange_body *body);

/* After the start: set nominal values. False, with reasons, when contacts or the record need more than an
 * integrator. */
bool vi_exchange_begin(const vi_exchange_body *body, char message[VI_MESSAGE_LENGTH]);

bool vi_exchange_set_time(const vi_exchange_body *body, double time);
void vi_exchange_get_states(const vi_exchange_body *body, double states[]);
void vi_exchange_set_states(const vi_exchange_body *body, const double states[]);
bool vi_exchange_states_are_finite(const vi_exchange_body *body);
void vi_exchange_get_nominals(const vi_exchange_body *body, double nominals[]);
void vi_exchange_get_derivatives(const vi_exchange_body *body, double derivatives[]);
void vi_exchange_get_indicators(const vi_exchange_body *body, double indicators[]);

/* Write the indicators to the outputs of the contacts. */
void vi_exchange_show_indicators(const vi_exchange_body *body);

/* Resolve all events at this instant: impacts, touch-downs, separations, sticks, releases. *changed: states or forces
 * have jumped; *limit: impact_limit is reached. Returns false, with the reason, when time stands still. */
bool vi_exchange_event(const vi_exchange_body *body, bool *changed, bool *limit, char message[VI_MESSAGE_LENGTH]);

/* Contacts that touched leave, or stay held. */
void vi_exchange_go_on(const vi_exchange_body *body);

#endif
