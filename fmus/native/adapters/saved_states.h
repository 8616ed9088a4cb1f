/* Saved states of an instance, also as bytes: what both adapters get, set, serialize and free. */
#ifndef VIBROIMPACT_SAVED_STATES_H
#define VIBROIMPACT_SAVED_STATES_H

#include "instance.h"

typedef struct vi_saved vi_saved;

/* Save into *saved (reused when large enough, else allocated); false when memory is out. */
bool vi_instance_save(vi_instance *instance, const char *function, vi_saved **saved);
bool vi_instance_restore(vi_instance *instance, const char *function, const vi_saved *saved);
size_t vi_saved_size(const vi_saved *saved);
void vi_saved_write(const vi_saved *saved, unsigned char *bytes);
/* A state from bytes; NULL (after logging) when they are not a state of this component. */
vi_saved *vi_saved_read(vi_instance *instance, const char *function, const unsigned char *bytes, size_t size);
void vi_saved_free(vi_saved *saved);

#endif
