/* Derivatives of an instance at the present instant, over other variables and over time, for both versions of FMI. Refused calls are logged. */
#ifndef VIBROIMPACT_DERIVATIVES_H
#define VIBROIMPACT_DERIVATIVES_H

#include "model_exchange.h"

/* The arguments of a call. Directional: one seed for each known, one sensitivity for each unknown; adjoint: the other way
 * round. All variables are scalars. */
typedef struct {
    const uint32_t *unknowns, *knowns;
    size_t unknown_count, known_count;
    const double *seed;
    size_t seed_count;
    double *sensitivity;
    size_t sensitivity_count;
    bool adjoint;
} vi_derivative_call;

/* Compute the sensitivities. VI_DISCARD: states or derivatives are not finite. */
vi_status vi_instance_derive(vi_instance *instance, const char *function, const vi_derivative_call *call);

/* Compute derivatives over time of these orders at a communication point, while inputs keep their slopes. */
vi_status vi_instance_differentiate(vi_instance *instance, const char *function, const uint32_t references[],
                                    const int32_t orders[], double values[], size_t count);

#endif
