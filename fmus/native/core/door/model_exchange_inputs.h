/* Inputs of an FMU for model exchange: a change lets the solver begin anew, or is an event. */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_INPUTS_H
#define VIBROIMPACT_MODEL_EXCHANGE_INPUTS_H

#include <stddef.h>
#include <stdint.h>

#include "door/door.h"
#include "door/model_exchange.h"

/* The inputs of one type that are set together. */
typedef struct {
    vi_exchange *exchange;
    vi_exchange_function get, set; /* of the FMU */
    void *values;                  /* room for a copy of all values */
    const unsigned char *discrete; /* [references] inputs that may change in event mode alone */
    int64_t size;                  /* bytes of a value */
    int64_t number;                /* number noted before a call */
} vi_exchange_input;

/* Set inputs, in the forms of FMI 3.0 and 2.0; a discrete input changes in an event mode of its own. */
VI_DOOR int vi_door_exchange_set3(vi_exchange_input *input, const uint32_t references[], size_t count,
                                  const void *values, size_t value_count);
VI_DOOR int vi_door_exchange_set2(vi_exchange_input *input, const uint32_t references[], size_t count,
                                  const void *values);

#endif
