#include "derivatives.h"

#include <math.h>
#include <string.h>

/* One end of the linear map: its variables, and how a component describes them. */
typedef struct {
    const char *kind; /* in messages */
    const uint32_t *references;
    size_t count;
    bool (*line)(void *self, uint32_t value_reference, vi_line *line);
} end_of_map;

/* ---- lines ---- */

static void clear(vi_line *line)
{
    memset(line, 0, offsetof(vi_line, own));
}

/* Add a multiple of a line to a change. */
static void add(const vi_line *line, double factor, vi_variation *change)
{
    for (int i = 0; i < line->count; ++i) {
        const double part = factor * line->shape[i];
        change->displacement[line->first + i] += line->displacement * part;
        change->velocity[line->first + i] += line->velocity * part;
        change->load[line->first + i] += line->load * part;
    }
    change->base += factor * line->base;
    change->contact[line->port] += factor * line->force;
}

/* ---- variables ---- */

/* Find the line of a variable. A state is a known only where it is no result of the start. */
static bool find_line(vi_instance *instance, const char *function, const end_of_map *end, uint32_t reference,
                      vi_line *line)
{
    const vi_variable *variable = vi_instance_find(instance, function, VI_FLOAT64, reference);
    if (variable == NULL) {
        return false;
    }
    if (variable->access == VI_SENSITIVITY) {
        return vi_instance_fail(instance, function, "value reference %lu is no %s here", (unsigned long)reference,
                                end->kind);
    }
    const bool fixed = end->line == vi_this_component.partial->column && variable->access == VI_SET_STATE
                       && instance->mode == VI_MODE_INITIALIZATION;
    clear(line);
    if (!fixed && variable->count == 1
        && end->line(instance->self, (uint32_t)(variable - vi_this_description.variables), line)) {
        return true;
    }
    return vi_instance_fail(instance, function, "value reference %lu is no %s here", (unsigned long)reference, end->kind);
}

static bool sizes_are_right(vi_instance *instance, const char *function, const vi_derivative_call *call)
{
    const size_t seeds = call->adjoint ? call->unknown_count : call->known_count;
    const size_t results = call->adjoint ? call->known_count : call->unknown_count;
    if ((call->unknowns == NULL && call->unknown_count > 0) || (call->knowns == NULL && call->known_count > 0)
        || (call->seed == NULL && seeds > 0) || (call->sensitivity == NULL && results > 0)) {
        return vi_instance_fail(instance, function, "expected value references, seed and sensitivity, got null");
    }
    return (call->seed_count == seeds && call->sensitivity_count == results)
           || vi_instance_fail(instance, function, "expected %lu seeds and room for %lu sensitivities, got %lu and %lu",
                               (unsigned long)seeds, (unsigned long)results, (unsigned long)call->seed_count,
                               (unsigned long)call->sensitivity_count);
}

/* Bring the component to the present instant; false, after logging, when its parameters are bad. */
static bool begin(vi_instance *instance, const char *function)
{
    if (instance->mode == VI_MODE_INITIALIZATION) {
        instance->message[0] = '\0';
        if (!vi_this_component.initialize(instance->self, instance->start_time, instance->message)) {
            return vi_instance_fail(instance, function, "%s", instance->message);
        }
    }
    if (vi_this_component.partial->begin != NULL) {
        vi_this_component.partial->begin(instance->self);
    }
    return true;
}

static bool is_finite(vi_instance *instance, const char *function, const double values[], size_t count)
{
    const vi_model_exchange *exchange = vi_this_component.exchange;
    bool finite = exchange == NULL || exchange->states == NULL || exchange->states_are_finite(instance->self);
    for (size_t i = 0; i < count; ++i) {
        finite = finite && isfinite(values[i]);
    }
    if (!finite) {
        vi_instance_warn(instance, function, "expected finite states, seeds and derivatives, got others");
    }
    return finite;
}

/* ---- over other variables ---- */

vi_status vi_instance_derive(vi_instance *instance, const char *function, const vi_derivative_call *call)
{
    const vi_partial_derivatives *partial = vi_this_component.partial;
    vi_variation change;
    vi_line line;
    if (instance != NULL && partial == NULL) {
        vi_instance_fail(instance, function, "not available in this component");
        return VI_ERROR;
    }
    if (!vi_instance_expect(instance, function, VI_MODE_INITIALIZATION | VI_RUNNING | VI_MODE_TERMINATED)
        || !sizes_are_right(instance, function, call) || !begin(instance, function)) {
        return VI_ERROR;
    }
    const end_of_map known = {"known", call->knowns, call->known_count, partial->column};
    const end_of_map unknown = {"unknown", call->unknowns, call->unknown_count, partial->row};
    const end_of_map *from = call->adjoint ? &unknown : &known, *to = call->adjoint ? &known : &unknown;
    void (*carry)(void *self, vi_variation *change) = call->adjoint ? partial->carry_back : partial->carry;
    memset(&change, 0, sizeof change);
    for (size_t i = 0; i < from->count; ++i) {
        if (!find_line(instance, function, from, from->references[i], &line)) {
            return VI_ERROR;
        }
        add(&line, call->seed[i], &change);
    }
    if (carry != NULL) {
        carry(instance->self, &change);
    }
    for (size_t i = 0; i < to->count; ++i) {
        if (!find_line(instance, function, to, to->references[i], &line)) {
            return VI_ERROR;
        }
        call->sensitivity[i] = vi_line_read(&line, &change);
    }
    return is_finite(instance, function, call->sensitivity, call->sensitivity_count) ? VI_OK : VI_DISCARD;
}

/* ---- over time ---- */

/* Find the carried changes up to an order, `known` of which are; false after logging. */
VI_RARE static bool find_rates(vi_instance *instance, const char *function, int order, vi_variation rate[], int *known)
{
    const vi_partial_derivatives *partial = vi_this_component.partial;
    for (; *known < order; ++*known) {
        vi_variation *change = &rate[*known];
        memset(change, 0, sizeof *change);
        const char *reason = partial->rate != NULL ? partial->rate(instance->self, *known + 1, rate, change) : NULL;
        if (reason != NULL) {
            return vi_instance_fail(instance, function, "expected a motion with derivatives over time, got %s", reason);
        }
        if (partial->carry != NULL) {
            partial->carry(instance->self, change);
        }
    }
    return true;
}

VI_RARE vi_status vi_instance_differentiate(vi_instance *instance, const char *function, const uint32_t references[],
                                    const int32_t orders[], double values[], size_t count)
{
    const vi_partial_derivatives *partial = vi_this_component.partial;
    vi_variation rate[VI_MOST_ORDER];
    int known = 0;
    vi_line line;
    if (instance != NULL && partial == NULL && count > 0) {
        vi_instance_fail(instance, function, "not available in this component");
        return VI_ERROR;
    }
    if (instance == NULL || !vi_instance_expect_steps(instance, function)
        || !vi_instance_expect(instance, function, VI_RUNNING | VI_MODE_TERMINATED)) {
        return VI_ERROR;
    }
    if (count > 0 && (references == NULL || orders == NULL || values == NULL)) {
        vi_instance_fail(instance, function, "expected value references, orders and room for values, got null");
        return VI_ERROR;
    }
    if (count > 0 && partial->begin != NULL) {
        partial->begin(instance->self);
    }
    const end_of_map unknown = {"output", references, count, count > 0 ? partial->row : NULL};
    for (size_t i = 0; i < count; ++i) {
        const int order = orders[i];
        if (order < 1 || order > VI_MOST_ORDER) {
            vi_instance_fail(instance, function, "expected an order from 1 to %d, got %ld", VI_MOST_ORDER, (long)order);
            return VI_ERROR;
        }
        if (!find_line(instance, function, &unknown, references[i], &line)
            || !find_rates(instance, function, order, rate, &known)) {
            return VI_ERROR;
        }
        const vi_variable *variable = vi_instance_find(instance, function, VI_FLOAT64, references[i]);
        const uint32_t own = (uint32_t)(variable - vi_this_description.variables);
        values[i] = vi_line_read(&line, &rate[order - 1]);
        values[i] += order == 2 && partial->bend != NULL ? partial->bend(instance->self, own) : 0.0;
    }
    return is_finite(instance, function, values, count) ? VI_OK : VI_DISCARD;
}
