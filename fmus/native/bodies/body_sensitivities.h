/* Derivatives of a body's outputs over its parameters since the start, in co-simulation. equations.md 6.17 */
#ifndef VIBROIMPACT_BODY_SENSITIVITIES_H
#define VIBROIMPACT_BODY_SENSITIVITIES_H

#include "body/modal/structure/parameter.h"
#include "component.h"

/* Pairs of an output and a parameter, and their derivatives. */
typedef struct {
    int64_t count;
    uint32_t key[VI_KEYS];        /* references of the parameters */
    uint32_t output[VI_MOST_SENSITIVITIES];
    int32_t of[VI_MOST_SENSITIVITIES]; /* index of the parameter */
    double value[VI_MOST_SENSITIVITIES];
} vi_followed;

/* Take the pairs of a description, after `defaults`; as vi_component has it. */
bool vi_body_follow(void *self, const vi_derivative_pair pairs[], size_t count, char message[VI_MESSAGE_LENGTH]);

size_t vi_body_followed(void);

/* Clear the derivatives before a start; find them and the parameters after it, or complain. */
void vi_body_clear_sensitivities(void *self);
void vi_body_start_sensitivities(void *self, char message[VI_MESSAGE_LENGTH]);

/* The forcing has another angular frequency from now on. */
void vi_body_retune_sensitivities(void *self);

/* Compute the values of all pairs. */
void vi_body_show_sensitivities(void *self);

/* Set the slopes of the forcing over the amplitude at this offset, on which it depends linearly. Returns true. */
bool vi_body_forcing_slopes(void *self, size_t offset, vi_parameter *parameter);

#endif
