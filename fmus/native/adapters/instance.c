#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model_exchange.h"
#include "sizes.h"

static const vi_component *const component = &vi_this_component;
static const vi_description *const description = &vi_this_description;

/* Largest time by which a step may pass the stop time, relative to 1 + |time|: the rounding of an importer's sums. */
#define STOP_ROUNDING 1e-9

/* Most states of a body: a displacement and a velocity of each mode. */
enum { MOST_STATES = 2 * VI_MODES };

/* ---- instances ---- */

bool vi_token_fits(const char *token)
{
    static const char own[] = "000000000000}"; /* length of an export's own part */
    const size_t length = strlen(description->token);
    return token != NULL && strlen(token) == length && length >= sizeof own - 1
           && strncmp(token, description->token, length - (sizeof own - 1)) == 0;
}

bool vi_token_is_of_export(const char *token)
{
    return strcmp(token, description->token) != 0;
}

vi_instance *vi_instance_new(const char *name)
{
    vi_instance *instance = calloc(1, sizeof(vi_instance));
    void *self = calloc(1, description->struct_size);
    const size_t length = strlen(name) + 1;
    char *copy = malloc(length);
    if (instance == NULL || self == NULL || copy == NULL) {
        free(instance);
        free(self);
        free(copy);
        return NULL;
    }
    memcpy(copy, name, length);
    instance->name = copy;
    instance->self = self;
    vi_instance_reset(instance);
    return instance;
}

void vi_instance_free(vi_instance *instance)
{
    if (instance != NULL) {
        if (instance->resources != NULL) {
            component->close(instance->resources);
        }
        free(instance->self);
        free(instance->name);
        free(instance->starts);
        free(instance->references);
        free(instance->pairs);
        free(instance->slots);
        free(instance->knowns.references);
        free(instance->unknowns.references);
        free(instance);
    }
}

static void announce(vi_instance *instance, uint32_t reference)
{
    if (component->was_set != NULL) {
        component->was_set(instance->self, reference);
    }
}

/* Put a start value. Variables that may not be set, and arrays, have no start values. */
static void put_start(vi_instance *instance, const vi_start *start)
{
    const vi_variable *variable =
        start->reference < description->variable_count ? &description->variables[start->reference] : NULL;
    if (variable == NULL || variable->access == VI_READ_ONLY || variable->access == VI_SET_STATE
        || variable->count != 1) {
        return;
    }
    char *field = (char *)instance->self + variable->offset;
    const int32_t truth = start->bits != 0;
    if (variable->type == VI_BOOLEAN) {
        memcpy(field, &truth, sizeof truth);
    } else {
        memcpy(field, &start->bits, sizeof start->bits);
    }
    announce(instance, start->reference);
}

void vi_instance_reset(vi_instance *instance)
{
    memset(instance->self, 0, description->struct_size - component->cache_size);
    component->defaults(instance->self);
    if (component->attach != NULL) {
        component->attach(instance->self, instance->resources);
    }
    for (int i = 0; component->sized != NULL && i < instance->sizes.count; ++i) {
        component->sized(instance->self, instance->sizes.of[i].block, instance->sizes.of[i].size);
    }
    if (instance->exchange) {
        vi_instance_exchange(instance);
    }
    if (instance->pair_count > 0) { /* they were taken once, in describe */
        (void)component->follow(instance->self, instance->pairs, instance->pair_count, instance->message);
    }
    for (size_t i = 0; i < instance->start_count; ++i) {
        put_start(instance, &instance->starts[i]);
    }
    instance->mode = VI_MODE_INSTANTIATED;
    instance->outputs_stale = false;
    instance->start_time = 0.0;
    instance->stop_time = HUGE_VAL;
}

enum { LEVEL_WARNING = 1, LEVEL_ERROR = 3 }; /* levels of both versions of FMI */

static void report(const vi_instance *instance, int level, const char *category, const char *function,
                   const char *format, va_list arguments)
{
    char text[VI_MESSAGE_LENGTH + 128];
    const int used = snprintf(text, sizeof text, "%s: %s: ", instance->name, function);
    const size_t start = used > 0 && (size_t)used < sizeof text ? (size_t)used : 0;
    (void)vsnprintf(text + start, sizeof text - start, format, arguments);
    if (instance->log != NULL) {
        instance->log(instance, level, category, text);
    }
}

bool vi_instance_fail(vi_instance *instance, const char *function, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    report(instance, LEVEL_ERROR, "logStatusError", function, format, arguments);
    va_end(arguments);
    return false;
}

void vi_instance_warn(const vi_instance *instance, const char *function, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    report(instance, LEVEL_WARNING, "logStatusWarning", function, format, arguments);
    va_end(arguments);
}

static bool number(vi_instance *instance, const char *function, const char *folder)
{
    const size_t most = description->variable_count + VI_MOST_SENSITIVITIES;
    instance->references = calloc(most, sizeof *instance->references);
    if (instance->references == NULL) {
        return vi_instance_fail(instance, function, "out of memory");
    }
    instance->reference_count = vi_references_read(folder, instance->references, most);
    return instance->reference_count > 0
           || vi_instance_fail(instance, function, "expected the FMU's folder of resources with references.txt, got %s",
                               folder != NULL ? folder : "none");
}

/* Read the pairs whose derivatives are followed, and make a variable of each. */
VI_RARE static bool follow(vi_instance *instance, const char *function, const char *folder)
{
    vi_derivative_pair first;
    if (component->follow == NULL || vi_pairs_read(folder, &first, 1) == 0) {
        return true;
    }
    instance->pairs = calloc(VI_MOST_SENSITIVITIES, sizeof *instance->pairs);
    instance->slots = calloc(VI_MOST_SENSITIVITIES, sizeof *instance->slots);
    if (instance->pairs == NULL || instance->slots == NULL) {
        return vi_instance_fail(instance, function, "out of memory");
    }
    const size_t count = vi_pairs_read(folder, instance->pairs, VI_MOST_SENSITIVITIES);
    for (size_t i = 0; i < count; ++i) {
        const vi_derivative_pair *pair = &instance->pairs[i];
        if (pair->unknown >= description->variable_count || pair->known >= description->variable_count) {
            return vi_instance_fail(instance, function, "sensitivities.txt: expected value references below %lu, got %lu"
                                    " and %lu", (unsigned long)description->variable_count,
                                    (unsigned long)pair->unknown, (unsigned long)pair->known);
        }
        instance->slots[i] = (vi_variable){VI_FLOAT64, VI_SENSITIVITY, 1,
                                           (uint32_t)(component->followed() + i * sizeof(double))};
    }
    instance->message[0] = '\0';
    if (!component->follow(instance->self, instance->pairs, count, instance->message)) {
        return vi_instance_fail(instance, function, "%s", instance->message);
    }
    instance->pair_count = count;
    return true;
}

bool vi_instance_describe(vi_instance *instance, const char *function, const char *folder, bool numbered)
{
    if (numbered && !number(instance, function, folder)) {
        return false;
    }
    vi_sizes_read(folder, &instance->sizes);
    for (int i = 0; i < instance->sizes.count; ++i) {
        instance->structural = instance->structural || strcmp(instance->sizes.of[i].block, "structural") == 0;
    }
    instance->starts = calloc(description->variable_count, sizeof(vi_start));
    if (instance->starts == NULL) {
        return vi_instance_fail(instance, function, "out of memory");
    }
    instance->start_count = vi_starts_read(folder, instance->starts, description->variable_count);
    if (component->open != NULL) {
        instance->message[0] = '\0';
        instance->resources = component->open(folder, instance->message);
        if (instance->resources == NULL) {
            return vi_instance_fail(instance, function, "%s", instance->message);
        }
    }
    if (!follow(instance, function, folder)) {
        return false;
    }
    vi_instance_reset(instance);
    return true;
}

static const char *mode_name(vi_mode_of_use mode)
{
    switch (mode) {
    case VI_MODE_INSTANTIATED: return "instantiated";
    case VI_MODE_INITIALIZATION: return "initialization mode";
    case VI_MODE_STEP: return "step mode";
    case VI_MODE_EVENT: return "event mode";
    case VI_MODE_TERMINATED: return "terminated";
    case VI_MODE_FAILED: return "failed";
    case VI_MODE_CONTINUOUS: return "continuous-time mode";
    case VI_MODE_CONFIGURATION: return "configuration mode";
    }
    return "unknown";
}

bool vi_instance_expect(vi_instance *instance, const char *function, int modes)
{
    if (instance == NULL || ((int)instance->mode & modes) != 0) {
        return instance != NULL;
    }
    return vi_instance_fail(instance, function, "not allowed now: the instance is %s", mode_name(instance->mode));
}

bool vi_instance_enter(vi_instance *instance, const char *function, int from, vi_mode_of_use to)
{
    if (!vi_instance_expect(instance, function, from)) {
        return false;
    }
    instance->mode = to;
    return true;
}

bool vi_instance_expect_steps(vi_instance *instance, const char *function)
{
    return instance == NULL || !instance->exchange
           || vi_instance_fail(instance, function, "not allowed: the instance was made for model exchange. Integrate its"
                               " states, or make one for co-simulation");
}

bool vi_instance_set_experiment(vi_instance *instance, const char *function, double start, double stop)
{
    if (stop < start || isnan(stop)) {
        return vi_instance_fail(instance, function, "expected a stop time that is not before the start time %.17g s, got"
                                " %.17g s", start, stop);
    }
    instance->start_time = start;
    instance->stop_time = stop;
    return true;
}

bool vi_instance_expect_end(vi_instance *instance, const char *function, double time, double size)
{
    const double stop = instance->stop_time;
    if (!(time + size > stop + STOP_ROUNDING * (1.0 + fabs(stop)))) {
        return true;
    }
    return vi_instance_fail(instance, function, "expected a step that ends by the stop time %.17g s, got one from %.17g s "
                            "by %.17g s", stop, time, size);
}

bool vi_instance_initialize(vi_instance *instance, const char *function)
{
    instance->message[0] = '\0';
    if (!component->initialize(instance->self, instance->start_time, instance->message)) {
        return vi_instance_fail(instance, function, "%s", instance->message);
    }
    if (instance->exchange && !vi_instance_begin_exchange(instance, function)) {
        return false;
    }
    if (instance->message[0] != '\0') {
        vi_instance_warn(instance, function, "%s", instance->message);
    }
    instance->outputs_stale = false;
    return true;
}

double vi_instance_time(const vi_instance *instance)
{
    const char *field = (const char *)instance->self + description->time;
    return component->time != NULL ? component->time(instance->self) : *(const double *)(const void *)field;
}

vi_step_result vi_instance_step(vi_instance *instance, const vi_step_request *request)
{
    instance->message[0] = '\0';
    return component->step(instance->self, request, instance->message);
}

/* ---- variables ---- */

const vi_variable *vi_instance_find(vi_instance *instance, const char *function, int type, uint32_t reference)
{
    size_t own = reference;
    if (instance->references != NULL) {
        const bool described = reference >= 1 && reference <= instance->reference_count;
        own = described ? instance->references[reference - 1] : SIZE_MAX;
    }
    if (own >= description->variable_count && own - description->variable_count < instance->pair_count
        && type == VI_FLOAT64) {
        return &instance->slots[own - description->variable_count];
    }
    if (own >= description->variable_count || description->variables[own].type != type) {
        vi_instance_fail(instance, function, "value reference %lu is not a variable of this type",
                         (unsigned long)reference);
        return NULL;
    }
    return &description->variables[own];
}

void vi_instance_refresh(vi_instance *instance)
{
    if (!instance->outputs_stale) {
        return;
    }
    if (instance->mode == VI_MODE_INITIALIZATION) {
        /* outputs follow the start values; a bad parameter is reported when initialization ends */
        instance->message[0] = '\0';
        (void)component->initialize(instance->self, instance->start_time, instance->message);
    } else if (((int)instance->mode & VI_RUNNING) != 0) {
        component->update_outputs(instance->self);
    }
    instance->outputs_stale = false;
}

static bool all_values_used(vi_instance *instance, const char *function, size_t used, size_t given)
{
    return used == given || vi_instance_fail(instance, function, "expected %lu values, got %lu", (unsigned long)used,
                                             (unsigned long)given);
}

bool vi_instance_get(vi_instance *instance, const char *function, int type, const uint32_t references[], size_t n,
                     void *values, size_t value_count, vi_convert convert)
{
    vi_instance_refresh(instance);
    size_t first = 0;
    for (size_t i = 0; i < n; ++i) {
        const vi_variable *variable = vi_instance_find(instance, function, type, references[i]);
        if (variable == NULL) {
            return false;
        }
        if (variable->count > value_count - first) {
            return vi_instance_fail(instance, function, "expected room for more than %lu values",
                                    (unsigned long)value_count);
        }
        convert((char *)instance->self + variable->offset, values, first, variable->count);
        first += variable->count;
    }
    return all_values_used(instance, function, first, value_count);
}

/* May single states be set? They may where all states may: some tools build a Jacobian this way. */
static bool may_set_states(const vi_instance *instance)
{
    return instance->exchange && instance->mode == VI_MODE_CONTINUOUS;
}

/* Structural parameters belong to configuration mode. Tools that know none set them as other parameters before
 * initialization, so the instance takes them there, too, and says so. */
static bool may_configure(vi_instance *instance, const char *function, uint32_t reference)
{
    if (instance->mode == VI_MODE_INSTANTIATED) {
        vi_instance_warn(instance, function, "value reference %lu is a structural parameter: expected configuration mode,"
                         " got it without. It was set all the same", (unsigned long)reference);
    } else if (instance->mode != VI_MODE_CONFIGURATION) {
        return vi_instance_fail(instance, function, "value reference %lu is a structural parameter, and can be set before"
                                " initialization only: the instance is %s", (unsigned long)reference,
                                mode_name(instance->mode));
    }
    return true;
}

static bool may_set(vi_instance *instance, const char *function, const vi_variable *variable, uint32_t reference)
{
    if (variable->access == VI_SET_STATE && may_set_states(instance)) {
        return true;
    }
    if (variable->access == VI_READ_ONLY || variable->access == VI_SET_STATE || variable->access == VI_SENSITIVITY) {
        return vi_instance_fail(instance, function, "value reference %lu cannot be set", (unsigned long)reference);
    }
    if (variable->access == VI_SET_STRUCTURAL && instance->structural) {
        return may_configure(instance, function, reference);
    }
    const bool initial = variable->access == VI_SET_INITIAL || variable->access == VI_SET_STRUCTURAL;
    const int modes = initial ? VI_BEFORE_START : VI_BEFORE_START | VI_RUNNING;
    if (((int)instance->mode & modes) == 0) {
        return vi_instance_fail(instance, function, "value reference %lu cannot be set: the instance is %s",
                                (unsigned long)reference, mode_name(instance->mode));
    }
    return true;
}

/* Place of a state in the description, whose two halves may be shorter than those compiled in. */
static size_t place_of_state(const vi_instance *instance, uint32_t own)
{
    const size_t most = description->state_count / 2, described = component->exchange->states(instance->self) / 2;
    size_t i = 0;
    while (i < description->state_count && description->states[i] != own) {
        ++i;
    }
    return i / most * described + i % most;
}

bool vi_instance_set(vi_instance *instance, const char *function, int type, const uint32_t references[], size_t n,
                     const void *values, size_t value_count, vi_convert convert)
{
    double states[MOST_STATES];
    bool changes_states = false;
    size_t first = 0;
    for (size_t i = 0; i < n; ++i) {
        const vi_variable *variable = vi_instance_find(instance, function, type, references[i]);
        if (variable == NULL || !may_set(instance, function, variable, references[i])) {
            return false;
        }
        if (variable->count > value_count - first) {
            return vi_instance_fail(instance, function, "expected more than %lu values", (unsigned long)value_count);
        }
        void *field = (char *)instance->self + variable->offset;
        const uint32_t own = (uint32_t)(variable - description->variables);
        if (variable->access == VI_SET_STATE) {
            if (!changes_states) {
                component->exchange->get_states(instance->self, states);
            }
            changes_states = true;
            field = &states[place_of_state(instance, own)];
        }
        convert(field, (void *)(uintptr_t)values, first, variable->count);
        if (variable->access != VI_SET_STATE) {
            announce(instance, own);
        }
        first += variable->count;
    }
    if (changes_states) {
        component->exchange->set_states(instance->self, states);
    }
    instance->outputs_stale = true;
    return all_values_used(instance, function, first, value_count);
}

void vi_read_doubles(void *field, void *values, size_t first, size_t count)
{
    memcpy((double *)values + first, field, count * sizeof(double));
}

void vi_write_doubles(void *field, void *values, size_t first, size_t count)
{
    memcpy(field, (const double *)values + first, count * sizeof(double));
}
