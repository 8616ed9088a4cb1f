#include "derivatives.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* One end of the linear map: its variables, and how a component describes them. */
typedef struct {
    const char *kind; /* in messages */
    const uint32_t *references;
    size_t count;
    bool (*line)(void *self, uint32_t value_reference, vi_line *line);
    vi_order *order;
} end_of_map;

/* ---- lines ---- */

/* Assignments one by one: a string of stores for all bytes takes as long as the rest of a line. */
static void clear(vi_line *line)
{
    line->shape = line->weight = NULL;
    line->first = line->count = line->alike = line->used = line->rows = line->port = 0;
    line->displacement = line->velocity = line->load = line->base = line->force = 0.0;
}

static double weight_of(const vi_line *line, size_t m)
{
    return line->weight != NULL ? line->weight[m] : 1.0;
}

/* Has the component arrays of alike variables? */
enum { ARRAYS = VI_ONLY_MODES != 1 };

/* Rows of shapes that are summed at a time: several sums that do not wait for each other take the time of one. */
enum { ROWS = 4 };

/* Set the rows of `count` alike variables from variable m on; places beyond have the first of them. */
static void find_rows(const vi_line *line, size_t m, size_t count, const double *row[ROWS])
{
    for (size_t i = 0; i < ROWS; ++i) {
        row[i] = line->shape + (m + i < count ? m + i : m) * VI_MODES;
    }
}

/* Add multiples of alike lines to one part of a change. */
static void add_to(const vi_line *line, double factor, const double seed[], size_t count, double part[])
{
    const double *row[ROWS];
    double s[ROWS];
    part += line->first;
    if (!line->rows) {
        const double scale = factor * line->shape[0];
        for (size_t m = 0; m < count; ++m) {
            part[m] += scale * seed[m];
        }
        return;
    }
    for (size_t m = 0; m < count; m += ROWS) {
        find_rows(line, m, count, row);
        for (size_t i = 0; i < ROWS; ++i) {
            s[i] = m + i < count ? factor * (seed[m + i] * weight_of(line, m + i)) : 0.0;
        }
        for (int j = 0; j < line->count; ++j) {
            part[j] += (s[0] * row[0][j] + s[1] * row[1][j]) + (s[2] * row[2][j] + s[3] * row[3][j]);
        }
    }
}

/* Add a multiple of a line to a change. */
static void add_one(const vi_line *line, double factor, vi_variation *change)
{
    factor *= weight_of(line, 0);
    for (int i = 0; i < vi_line_count(line) && line->displacement != 0.0; ++i) {
        change->displacement[line->first + i] += line->displacement * (factor * line->shape[i]);
    }
    for (int i = 0; i < vi_line_count(line) && line->velocity != 0.0; ++i) {
        change->velocity[line->first + i] += line->velocity * (factor * line->shape[i]);
    }
    for (int i = 0; i < vi_line_count(line) && line->load != 0.0; ++i) {
        change->load[line->first + i] += line->load * (factor * line->shape[i]);
    }
    change->base += factor * line->base;
    change->contact[line->port] += factor * line->force;
}

/* Add multiples of alike lines, the first of them used. */
static void add(const vi_line *line, const double seed[], size_t count, vi_variation *change)
{
    const struct { double factor, *part; } ends[] = {{line->displacement, change->displacement},
                                                     {line->velocity, change->velocity},
                                                     {line->load, change->load}};
    if (!ARRAYS || count == 1) {
        add_one(line, seed[0], change);
        return;
    }
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; ++i) {
        if (ends[i].factor != 0.0) {
            add_to(line, ends[i].factor, seed, count, ends[i].part);
        }
    }
    for (size_t m = 0; m < count && line->base != 0.0; ++m) {
        change->base += seed[m] * line->base;
    }
}

/* Add the changes of alike lines in one part of a change to `sensitivity`. */
static void read_from(const vi_line *line, double factor, const double part[], size_t count, double sensitivity[])
{
    const double *row[ROWS];
    part += line->first;
    if (!line->rows) {
        const double scale = factor * line->shape[0];
        for (size_t m = 0; m < count; ++m) {
            sensitivity[m] += scale * part[m];
        }
        return;
    }
    for (size_t m = 0; m < count; m += ROWS) {
        double sum[ROWS] = {0.0};
        find_rows(line, m, count, row);
        for (int j = 0; j < line->count; ++j) {
            for (size_t i = 0; i < ROWS; ++i) {
                sum[i] += row[i][j] * part[j];
            }
        }
        for (size_t i = 0; i < ROWS && m + i < count; ++i) {
            sensitivity[m + i] += factor * sum[i] * weight_of(line, m + i);
        }
    }
}

/* Set the changes of alike lines, the first of which are used. */
static void read(const vi_line *line, const vi_variation *change, size_t count, double sensitivity[])
{
    const struct { double factor; const double *part; } ends[] = {{line->displacement, change->displacement},
                                                                  {line->velocity, change->velocity},
                                                                  {line->load, change->load}};
    if (!ARRAYS || count == 1) {
        sensitivity[0] = weight_of(line, 0) * vi_line_read(line, change);
        return;
    }
    for (size_t m = 0; m < count; ++m) {
        sensitivity[m] = line->base * change->base;
    }
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; ++i) {
        if (ends[i].factor != 0.0) {
            read_from(line, ends[i].factor, ends[i].part, count, sensitivity);
        }
    }
}

/* ---- variables ---- */

/* Why a variable is no known, or no unknown. */
VI_RARE static const char *reason_of(const vi_variable *variable, bool known)
{
    if (variable->count != 1 || variable->access == VI_SENSITIVITY) {
        return variable->count != 1 ? "an array" : "a derivative since the start";
    }
    switch (variable->access) {
    case VI_SET_INITIAL: return "a fixed parameter";
    case VI_READ_ONLY: return known ? "an output" : "an event indicator, or the time";
    case VI_SET_STATE: return "a state, which follows from the start values now";
    default: return known ? "it acts as an event, or moves a stop" : "an input, or a parameter";
    }
}

/* Find the line of a variable. A state is a known only where it is no result of the start. */
static bool find_line(vi_instance *instance, const char *function, const end_of_map *end, uint32_t reference,
                      vi_line *line)
{
    const vi_variable *variable = vi_instance_find(instance, function, VI_FLOAT64, reference);
    if (variable == NULL) {
        return false;
    }
    const bool is_known = end->line == vi_this_component.partial->column;
    const bool fixed = is_known && variable->access == VI_SET_STATE && instance->mode == VI_MODE_INITIALIZATION;
    clear(line);
    if (!fixed && variable->count == 1 && variable->access != VI_SENSITIVITY
        && end->line(instance->self, (uint32_t)(variable - vi_this_description.variables), line)) {
        return true;
    }
    return vi_instance_fail(instance, function, "value reference %lu is no %s here: %s", (unsigned long)reference, end->kind,
                            reason_of(variable, is_known));
}

/* ---- alike variables, one behind another in their array ---- */

static const uint32_t NONE = UINT32_MAX;
enum { OPEN = 4 }; /* arrays whose elements may take turns in a list */

/* The variable of a reference; NULL: there is none, or it is no element of an array of alike ones. */
static const vi_variable *element(const vi_instance *instance, uint32_t reference)
{
    size_t own = reference;
    if (instance->references != NULL) {
        own = reference >= 1 && reference <= instance->reference_count ? instance->references[reference - 1] : SIZE_MAX;
    }
    const vi_variable *variable = own < vi_this_description.variable_count ? &vi_this_description.variables[own] : NULL;
    return variable != NULL && variable->type == VI_FLOAT64 && variable->count == 1 ? variable : NULL;
}

static bool follows(const vi_variable *last, const vi_variable *variable)
{
    return last != NULL && variable != NULL && variable->access == last->access
           && variable->offset == last->offset + sizeof(double);
}

/* Put the places of variables that follow each other in an array behind each other. */
VI_RARE static void order_elements(const vi_instance *instance, vi_order *order)
{
    const vi_variable *last[OPEN] = {NULL};
    uint32_t *const next = order->run, *const head = order->head, place[OPEN] = {0};
    size_t turn = 0, heads = 0, put = 0;
    for (size_t i = 0; i < order->count; ++i) {
        const vi_variable *variable = element(instance, order->references[i]);
        size_t look = 1;
        while (look <= OPEN && !follows(last[(turn + look) % OPEN], variable)) {
            ++look;
        }
        turn = (turn + (look <= OPEN ? look : 1)) % OPEN;
        if (look <= OPEN) {
            next[place[turn]] = (uint32_t)i;
        } else {
            head[heads++] = (uint32_t)i;
        }
        last[turn] = variable;
        place[turn] = (uint32_t)i;
        next[i] = NONE;
    }
    for (size_t h = 0; h < heads; ++h) {
        for (uint32_t i = head[h]; i != NONE; i = next[i]) {
            order->place[put++] = i;
        }
        head[h] = (uint32_t)put;
    }
    for (size_t h = 0, i = 0; h < heads; ++h) {
        for (; i < head[h]; ++i) {
            order->run[i] = head[h] - (uint32_t)i;
        }
    }
}

/* Order the references of an end, unless those of the last call were the same: looking at them takes longer than all sums. */
static bool find_order(vi_instance *instance, const char *function, const end_of_map *end)
{
    vi_order *order = end->order;
    const size_t size = end->count * sizeof(uint32_t);
    if (!ARRAYS || end->count < 2
        || (order->count == end->count && memcmp(order->references, end->references, size) == 0)) {
        return true;
    }
    order->count = 0;
    if (end->count > order->room) {
        uint32_t *room = realloc(order->references, 4 * size);
        if (room == NULL) {
            return vi_instance_fail(instance, function, "out of memory");
        }
        order->references = room;
        order->room = end->count;
        order->place = room + order->room;
        order->run = order->place + order->room;
        order->head = order->run + order->room;
    }
    memcpy(order->references, end->references, size);
    order->count = end->count;
    order_elements(instance, order);
    return true;
}

/* A group of alike variables of an end. */
typedef struct {
    size_t first, count;   /* in the order of the end; count 0: at its end, or `failed` after logging */
    const uint32_t *place; /* of each variable */
    uint32_t only;         /* where there is no order */
    bool failed;
    vi_line line;
} group;

static void begin_groups(group *of)
{
    of->first = of->count = 0;
    of->failed = false;
    of->line.own_known = of->line.forces_known = 0;
}

/* Go on to the next group. */
static bool find_group(vi_instance *instance, const char *function, const end_of_map *end, group *of)
{
    const bool ordered = ARRAYS && end->count > 1;
    of->first += of->count;
    of->count = 0;
    if (of->first == end->count) {
        return false;
    }
    of->only = (uint32_t)of->first;
    of->place = ordered ? end->order->place + of->first : &of->only;
    of->failed = !find_line(instance, function, end, end->references[*of->place], &of->line);
    const size_t run = ordered ? end->order->run[of->first] : 1, alike = of->line.alike > 0 ? (size_t)of->line.alike : 1;
    of->count = of->failed ? 0 : run < alike ? run : alike;
    return of->count > 0;
}

/* Number of these alike variables that depend on anything. */
static size_t used_of(const vi_line *line, size_t count)
{
    const size_t used = line->used > 0 ? (size_t)line->used : 0;
    return !ARRAYS || line->alike == 0 || used > count ? count : used;
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

/* Look at the bits without their sign: the compiler makes fewer instructions of that. */
static bool are_finite(const double values[], size_t count)
{
    uint64_t bits, largest = 0;
    for (size_t i = 0; i < count; ++i) {
        memcpy(&bits, &values[i], sizeof bits);
        largest = bits << 1 > largest ? bits << 1 : largest;
    }
    return largest < UINT64_C(0xffe0000000000000);
}

/* Are the states, the seeds and their derivatives finite? If not, warn. */
static bool is_finite(vi_instance *instance, const char *function, const double seed[], size_t seeds,
                      const double values[], size_t count)
{
    const vi_model_exchange *exchange = vi_this_component.exchange;
    const bool finite = exchange == NULL || exchange->states == NULL || exchange->states_are_finite(instance->self);
    if (!finite || !are_finite(seed, seeds) || !are_finite(values, count)) {
        vi_instance_warn(instance, function, "expected finite states, seeds and derivatives, got others");
        return false;
    }
    return true;
}

/* ---- over other variables ---- */

/* Add the seeds of all variables of an end to a change. */
static bool add_all(vi_instance *instance, const char *function, const end_of_map *end, const double seed[],
                    vi_variation *change)
{
    group of;
    double seeds[VI_MODES];
    begin_groups(&of);
    while (find_group(instance, function, end, &of)) {
        for (size_t m = 0; m < of.count; ++m) {
            seeds[m] = seed[of.place[m]];
        }
        add(&of.line, seeds, used_of(&of.line, of.count), change);
    }
    return !of.failed;
}

/* Read the changes of all variables of an end. */
static bool read_all(vi_instance *instance, const char *function, const end_of_map *end, const vi_variation *change,
                     double sensitivity[])
{
    group of;
    double values[VI_MODES];
    begin_groups(&of);
    while (find_group(instance, function, end, &of)) {
        read(&of.line, change, used_of(&of.line, of.count), values);
        for (size_t m = used_of(&of.line, of.count); m < of.count; ++m) {
            values[m] = 0.0;
        }
        for (size_t m = 0; m < of.count; ++m) {
            sensitivity[of.place[m]] = values[m];
        }
    }
    return !of.failed;
}

vi_status vi_instance_derive(vi_instance *instance, const char *function, const vi_derivative_call *call)
{
    const vi_partial_derivatives *partial = vi_this_component.partial;
    vi_variation change;
    if (instance != NULL && partial == NULL) {
        vi_instance_fail(instance, function, "not available in this component");
        return VI_ERROR;
    }
    if (!vi_instance_expect(instance, function, VI_MODE_INITIALIZATION | VI_RUNNING | VI_MODE_TERMINATED)
        || !sizes_are_right(instance, function, call) || !begin(instance, function)) {
        return VI_ERROR;
    }
    const end_of_map known = {"known", call->knowns, call->known_count, partial->column, &instance->knowns};
    const end_of_map unknown = {"unknown", call->unknowns, call->unknown_count, partial->row, &instance->unknowns};
    const end_of_map *from = call->adjoint ? &unknown : &known, *to = call->adjoint ? &known : &unknown;
    void (*carry)(void *self, vi_variation *change) = call->adjoint ? partial->carry_back : partial->carry;
    memset(&change, 0, sizeof change);
    if (!find_order(instance, function, from) || !find_order(instance, function, to)
        || !add_all(instance, function, from, call->seed, &change)) {
        return VI_ERROR;
    }
    if (carry != NULL) {
        carry(instance->self, &change);
    }
    if (!read_all(instance, function, to, &change, call->sensitivity)) {
        return VI_ERROR;
    }
    return is_finite(instance, function, call->seed, call->seed_count, call->sensitivity, call->sensitivity_count)
               ? VI_OK
               : VI_DISCARD;
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
    line.own_known = line.forces_known = 0;
    const end_of_map unknown = {"output", references, count, count > 0 ? partial->row : NULL, NULL};
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
    return is_finite(instance, function, NULL, 0, values, count) ? VI_OK : VI_DISCARD;
}
