#include "saved_states.h"

#include <stdlib.h>
#include <string.h>

#include "hash.h"
#include "sparse.h"

/* A saved state: this header, then the used part of the component's struct without its zeros. */
typedef struct {
    char magic[8];
    uint64_t token_hash, state_hash;
    uint64_t size;             /* of the used part, bytes */
    uint64_t packed, capacity; /* of the data, and room for them, bytes */
    int64_t mode, exchange;
    double start_time;
    int64_t outputs_stale;
    unsigned char data[];
} vi_saved;

static const char MAGIC[8] = {'v', 'i', 'b', 's', 't', 'a', 't', '2'};

static uint64_t token_hash(void)
{
    return vi_hash(VI_HASH_START, vi_this_description.token, strlen(vi_this_description.token));
}

static size_t used_size(const vi_instance *instance)
{
    const bool whole = vi_this_component.used_size == NULL;
    return whole ? vi_this_description.struct_size : vi_this_component.used_size(instance->self);
}

/* Hash of everything in a state: the header from `size` on, and the data. */
static uint64_t state_hash(const vi_saved *header, const unsigned char *data)
{
    const size_t first = offsetof(vi_saved, size);
    const uint64_t h = vi_hash(VI_HASH_START, (const unsigned char *)header + first, sizeof(vi_saved) - first);
    return vi_hash(h, data, header->packed);
}

bool vi_state_save(vi_instance *instance, const char *function, void **state)
{
    if (instance == NULL || state == NULL) {
        return false;
    }
    const size_t size = used_size(instance);
    vi_saved *saved = *state;
    const size_t room = saved == NULL ? 0 : saved->capacity;
    const size_t packed = vi_sparse_pack(instance->self, size, saved == NULL ? NULL : saved->data, room);
    if (saved == NULL || packed > room) {
        saved = realloc(saved, sizeof(vi_saved) + packed);
        if (saved == NULL) {
            return vi_instance_fail(instance, function, "out of memory");
        }
        memset(saved, 0, sizeof(vi_saved));
        saved->capacity = packed;
        vi_sparse_pack(instance->self, size, saved->data, packed);
    }
    memcpy(saved->magic, MAGIC, sizeof MAGIC);
    saved->size = size;
    saved->packed = packed;
    saved->mode = (int64_t)instance->mode;
    saved->exchange = instance->exchange;
    saved->start_time = instance->start_time;
    saved->outputs_stale = instance->outputs_stale;
    *state = saved;
    return true;
}

bool vi_state_restore(vi_instance *instance, const char *function, const void *state)
{
    const vi_saved *saved = state;
    if (instance == NULL) {
        return false;
    }
    if (saved == NULL || saved->size > vi_this_description.struct_size) {
        return vi_instance_fail(instance, function, "expected a saved state, got none");
    }
    if (vi_this_component.sized_by_resources && saved->size != used_size(instance)) {
        return vi_instance_fail(instance, function, "expected a state that fits the FMU's resources, got one of others");
    }
    if ((saved->exchange != 0) != instance->exchange) {
        return vi_instance_fail(instance, function, "expected a state of an instance of %s, got one of %s",
                                instance->exchange ? "model exchange" : "co-simulation",
                                instance->exchange ? "co-simulation" : "model exchange");
    }
    vi_sparse_unpack(saved->data, instance->self, saved->size);
    instance->mode = (vi_mode_of_use)saved->mode;
    instance->start_time = saved->start_time;
    instance->outputs_stale = saved->outputs_stale != 0;
    return true;
}

bool vi_state_free(void **state)
{
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return true;
}

bool vi_state_size(const vi_instance *instance, const void *state, size_t *size)
{
    if (instance == NULL || state == NULL || size == NULL) {
        return false;
    }
    *size = sizeof(vi_saved) + ((const vi_saved *)state)->packed;
    return true;
}

bool vi_state_write(const vi_instance *instance, const void *state, unsigned char *bytes, size_t size)
{
    const vi_saved *saved = state;
    size_t needed;
    if (!vi_state_size(instance, state, &needed) || bytes == NULL || size < needed) {
        return false;
    }
    vi_saved header = *saved;
    header.token_hash = token_hash();
    header.capacity = saved->packed;
    header.state_hash = state_hash(&header, saved->data);
    memcpy(bytes, &header, sizeof header);
    memcpy(bytes + sizeof header, saved->data, saved->packed);
    return true;
}

bool vi_state_read(vi_instance *instance, const char *function, const unsigned char *bytes, size_t size, void **state)
{
    vi_saved header;
    if (instance == NULL || bytes == NULL || state == NULL) {
        return false;
    }
    if (size < sizeof header) {
        return vi_instance_fail(instance, function, "expected a serialized state, got %lu bytes", (unsigned long)size);
    }
    memcpy(&header, bytes, sizeof header);
    const unsigned char *data = bytes + sizeof header;
    if (memcmp(header.magic, MAGIC, sizeof MAGIC) != 0 || header.token_hash != token_hash()
        || header.packed != size - sizeof header || header.size > vi_this_description.struct_size
        || header.state_hash != state_hash(&header, data)
        || !vi_sparse_fits(data, header.packed, header.size)) {
        return vi_instance_fail(instance, function,
                                "these bytes are not an undamaged state of this component and version");
    }
    vi_saved *saved = malloc(size);
    if (saved == NULL) {
        return vi_instance_fail(instance, function, "out of memory");
    }
    memcpy(saved, bytes, size);
    saved->capacity = header.packed;
    *state = saved;
    return true;
}
