/* Saved states of an instance, also as bytes. Both versions of FMI call these functions with what they were given: NULL
 * where something is missing is false, without a word. */
#ifndef VIBROIMPACT_SAVED_STATES_H
#define VIBROIMPACT_SAVED_STATES_H

#include "instance.h"

/* Save into *state (reused when large enough, else allocated); false when memory is out. */
bool vi_state_save(vi_instance *instance, const char *function, void **state);
bool vi_state_restore(vi_instance *instance, const char *function, const void *state);
/* True, also where there is none; it is NULL afterwards. */
bool vi_state_free(void **state);

/* How many bytes it takes. */
bool vi_state_size(const vi_instance *instance, const void *state, size_t *size);
/* False where the bytes have no room for it. */
bool vi_state_write(const vi_instance *instance, const void *state, unsigned char *bytes, size_t size);
/* *state: a new one from bytes; false (after logging) when they are not a state of this component. */
bool vi_state_read(vi_instance *instance, const char *function, const unsigned char *bytes, size_t size, void **state);

#endif
