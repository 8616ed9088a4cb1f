/* Saved states of an instance, also as bytes. Arguments come unchecked from FMI: NULL gives false, without a
 * message. */
#ifndef VIBROIMPACT_SAVED_STATES_H
#define VIBROIMPACT_SAVED_STATES_H

#include "instance.h"

/* Save into *state (reused when large enough, otherwise allocated); false when memory is out. */
bool vi_state_save(vi_instance *instance, const char *function, void **state);
bool vi_state_restore(vi_instance *instance, const char *function, const void *state);
/* Free the state, if there is one, and set it to NULL; returns true. */
bool vi_state_free(void **state);

/* Number of bytes of a state. */
bool vi_state_size(const vi_instance *instance, const void *state, size_t *size);
/* Write a state as bytes; false when there is too little room. */
bool vi_state_write(const vi_instance *instance, const void *state, unsigned char *bytes, size_t size);
/* Make a new *state from bytes; false, after logging, when they are no state of this component. */
bool vi_state_read(vi_instance *instance, const char *function, const unsigned char *bytes, size_t size, void **state);

#endif
