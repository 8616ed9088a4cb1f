/* A body of N modes that the importer integrates: model exchange.
 *
 * States are the displacements, then the velocities, of the modes or of the masses. The status of each contact changes in
 * vi_exchange_event alone, so that derivatives and indicators are smooth between events. Of a contact's indicator the
 * sign tells: > 0 as long as nothing happens.
 */
#ifndef VIBROIMPACT_STRUCTURE_EXCHANGE_H
#define VIBROIMPACT_STRUCTURE_EXCHANGE_H

#include <stdbool.h>
#include <stddef.h>

#include "body/complaint.h"
#include "body/modal/state.h"

/* A body, and how its model description shows it. */
typedef struct {
    vi_structure parts;
    int modes, contacts;  /* of the description; those beyond the body's own stand still */
    double scale;         /* modal displacement for a state of 1 m, kg^(1/2); of states that are modal */
    /* of states that are those of masses: displacements of the masses for modal ones, and the masses; else NULL */
    const double (*shape)[VI_MODES];
    const double *mass;
    const char *refused;  /* what of the component's own parameters cannot be integrated, or NULL */
} vi_exchange_body;

void vi_exchange_enable(const vi_exchange_body *body);

/* After the start: nominal values; false with the reasons when contacts, or the record, ask for what an integrator cannot
 * give. */
bool vi_exchange_begin(const vi_exchange_body *body, char message[VI_MESSAGE_LENGTH]);

bool vi_exchange_set_time(const vi_exchange_body *body, double time);
void vi_exchange_get_states(const vi_exchange_body *body, double states[]);
void vi_exchange_set_states(const vi_exchange_body *body, const double states[]);
bool vi_exchange_states_are_finite(const vi_exchange_body *body);
void vi_exchange_get_nominals(const vi_exchange_body *body, double nominals[]);
void vi_exchange_get_derivatives(const vi_exchange_body *body, double derivatives[]);
void vi_exchange_get_indicators(const vi_exchange_body *body, double indicators[]);

/* The same as outputs of the contacts. */
void vi_exchange_show_indicators(const vi_exchange_body *body);

/* All that happens at this instant: impacts, touch-downs, separations, rests, releases. *changed: states or forces have jumped;
 * *limit: impact_limit is reached. False, with the reason, when time stands still. */
bool vi_exchange_event(const vi_exchange_body *body, bool *changed, bool *limit, char message[VI_MESSAGE_LENGTH]);

/* Contacts that touched leave, or stay held. */
void vi_exchange_go_on(const vi_exchange_body *body);

/* The table `NAME` of a component's functions of model exchange; `BIND(self)` returns its vi_exchange_body, and
 * `REFRESH(self)` gives inputs that were set to the body. */
#define VI_EXCHANGE_TABLE(NAME, BIND, REFRESH)                                                                       \
    static size_t NAME##_states(void *self)                                                                          \
    {                                                                                                                \
        return 2 * (size_t)BIND(self).modes;                                                                          \
    }                                                                                                                \
    static size_t NAME##_indicators(void *self)                                                                      \
    {                                                                                                                \
        return (size_t)BIND(self).contacts;                                                                           \
    }                                                                                                                \
    static void NAME##_enable(void *self)                                                                            \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        vi_exchange_enable(&body);                                                                                   \
    }                                                                                                                \
    static bool NAME##_begin(void *self, char message[VI_MESSAGE_LENGTH])                                            \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        return vi_exchange_begin(&body, message);                                                                    \
    }                                                                                                                \
    static bool NAME##_set_time(void *self, double time)                                                             \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        return vi_exchange_set_time(&body, time);                                                                    \
    }                                                                                                                \
    static void NAME##_get_states(void *self, double states[])                                                       \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        vi_exchange_get_states(&body, states);                                                                       \
    }                                                                                                                \
    static void NAME##_set_states(void *self, const double states[])                                                 \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        vi_exchange_set_states(&body, states);                                                                       \
    }                                                                                                                \
    static bool NAME##_states_are_finite(void *self)                                                                 \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        return vi_exchange_states_are_finite(&body);                                                                 \
    }                                                                                                                \
    static void NAME##_get_nominals(void *self, double nominals[])                                                   \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        vi_exchange_get_nominals(&body, nominals);                                                                   \
    }                                                                                                                \
    static void NAME##_get_derivatives(void *self, double derivatives[])                                             \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        REFRESH(self);                                                                                               \
        vi_exchange_get_derivatives(&body, derivatives);                                                             \
    }                                                                                                                \
    static void NAME##_get_indicators(void *self, double indicators[])                                               \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        REFRESH(self);                                                                                               \
        vi_exchange_get_indicators(&body, indicators);                                                               \
    }                                                                                                                \
    static bool NAME##_handle_event(void *self, bool *changed, bool *limit, char message[VI_MESSAGE_LENGTH])         \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        REFRESH(self);                                                                                               \
        return vi_exchange_event(&body, changed, limit, message);                                                    \
    }                                                                                                                \
    static void NAME##_go_on(void *self)                                                                             \
    {                                                                                                                \
        const vi_exchange_body body = BIND(self);                                                                    \
        vi_exchange_go_on(&body);                                                                                    \
    }                                                                                                                \
    static const vi_model_exchange NAME = {                                                                          \
        .states = NAME##_states,                                                                                     \
        .indicators = NAME##_indicators,                                                                             \
        .enable = NAME##_enable,                                                                                     \
        .begin = NAME##_begin,                                                                                       \
        .set_time = NAME##_set_time,                                                                                 \
        .get_states = NAME##_get_states,                                                                             \
        .set_states = NAME##_set_states,                                                                             \
        .states_are_finite = NAME##_states_are_finite,                                                               \
        .get_nominals = NAME##_get_nominals,                                                                         \
        .get_derivatives = NAME##_get_derivatives,                                                                   \
        .get_indicators = NAME##_get_indicators,                                                                     \
        .handle_event = NAME##_handle_event,                                                                         \
        .go_on = NAME##_go_on,                                                                                       \
    }

#endif
