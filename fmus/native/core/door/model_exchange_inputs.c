#include "door/model_exchange_inputs.h"

#include <math.h>
#include <string.h>

enum { OK = 0, ERROR = 3 };

/* FMI's functions that move variables. */
typedef int (*move3)(void *, const uint32_t[], size_t, const void *, size_t);
typedef int (*move2)(void *, const uint32_t[], size_t, const void *);

/* Make the call of FMI that moves `values`. */
static int move(vi_exchange_input *input, const vi_exchange_function *function, const uint32_t references[],
                size_t count, const void *values, size_t value_count)
{
    vi_exchange *e = input->exchange;
    if (e->noted_call != NULL) {
        *e->noted_call = input->number;
    }
    int status;
    if (e->version == 3) {
        move3 call;
        memcpy(&call, function, sizeof call);
        status = call(e->fmu, references, count, values, value_count);
    } else {
        move2 call;
        memcpy(&call, function, sizeof call);
        status = call(e->fmu, references, count, values);
    }
    if (status != OK) {
        e->function = VI_EXCHANGE_SET;
        e->reason = VI_EXCHANGE_STATUS;
    }
    return status;
}

/* Is a discrete input among those that differ from `values`? Arrays count as changed as a whole. */
static bool discrete_changes(const vi_exchange_input *input, size_t count, const char *values, size_t value_count)
{
    const size_t size = (size_t)input->size;
    const char *known = input->values;
    for (size_t i = 0; i < count; i++) {
        const bool same = count == value_count && memcmp(known + i * size, values + i * size, size) == 0;
        if (input->discrete[i] && !same) {
            return true;
        }
    }
    return false;
}

/* Iterate until the FMU has settled with its new inputs. */
static int settle(vi_exchange *e)
{
    for (int32_t i = 0; i < e->most_iterations; i++) {
        bool again = false, ends = false, nominals = false, values = false, has_next = false;
        double next = INFINITY;
        const int status = vi_door_exchange_update(e, &again, &ends, &nominals, &values, &has_next, &next);
        if (status != OK) {
            return status;
        }
        e->ends = e->ends || ends;
        if (!again || ends) {
            return vi_door_exchange_leave(e);
        }
    }
    e->function = VI_EXCHANGE_UPDATE;
    e->reason = VI_EXCHANGE_ENDLESS;
    return ERROR;
}

int vi_door_exchange_set3(vi_exchange_input *input, const uint32_t references[], size_t count, const void *values,
                          size_t value_count)
{
    vi_exchange *e = input->exchange;
    if (!e->has_begun || e->in_event_mode) {
        return move(input, &input->set, references, count, values, value_count);
    }
    int status = move(input, &input->get, references, count, input->values, value_count);
    if (status > 1 || memcmp(input->values, values, value_count * (size_t)input->size) == 0) {
        return status;
    }
    const bool is_event = discrete_changes(input, count, values, value_count);
    status = is_event ? vi_door_exchange_enter(e) : OK;
    status = status > 1 ? status : move(input, &input->set, references, count, values, value_count);
    if (is_event && status <= 1) {
        return settle(e);
    }
    e->inputs_changed = 1;
    return status;
}

int vi_door_exchange_set2(vi_exchange_input *input, const uint32_t references[], size_t count, const void *values)
{
    return vi_door_exchange_set3(input, references, count, values, count);
}
