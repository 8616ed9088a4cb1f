/* The common part of both adapters: instances, variables and saved states, for a small component of this test. */
#include "../../fmus/native/adapters/instance.c"
#include "../../fmus/native/adapters/model_exchange.c"
#include "../../fmus/native/adapters/resources.c"
#include "../../fmus/native/adapters/saved_states.c"
#include "../../fmus/native/adapters/sparse.c"

#include "check.h"

typedef struct {
    double time, parameter, input;
    int64_t count, size;
    int32_t flag;
    int64_t used;      /* rows */
    double rows[1000]; /* last member: saved as far as it is used */
} thing;

static const vi_variable thing_variables[] = {
    {VI_FLOAT64, VI_READ_ONLY, 1, offsetof(thing, time)},   {VI_FLOAT64, VI_SET_INITIAL, 1, offsetof(thing, parameter)},
    {VI_FLOAT64, VI_SET_INPUT, 1, offsetof(thing, input)},  {VI_INT64, VI_READ_ONLY, 1, offsetof(thing, count)},
    {VI_BOOLEAN, VI_SET_TUNABLE, 1, offsetof(thing, flag)}, {VI_FLOAT64, VI_READ_ONLY, 1000, offsetof(thing, rows)},
    {VI_INT64, VI_SET_STRUCTURAL, 1, offsetof(thing, size)},
};
enum { VARIABLES = sizeof thing_variables / sizeof thing_variables[0], SIZE = VARIABLES - 1 };

static void defaults(void *self)
{
    ((thing *)self)->parameter = 1.0;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    thing *t = self;
    t->time = start_time;
    if (t->parameter > 0.0) {
        return true;
    }
    /* the longest message */
    memset(message, 'x', VI_MESSAGE_LENGTH - 1);
    message[VI_MESSAGE_LENGTH - 1] = '\0';
    return false;
}

static void was_set(void *self, uint32_t reference)
{
    ((thing *)self)->count += reference;
}

static void update_outputs(void *self)
{
    ((thing *)self)->rows[0] = ((thing *)self)->input;
}

static size_t size_of_used(const void *self)
{
    return offsetof(thing, rows) + (size_t)((const thing *)self)->used * sizeof(double);
}

const vi_description vi_this_description = {
    .token = "{token}",
    .struct_size = sizeof(thing),
    .time = offsetof(thing, time),
    .variables = thing_variables,
    .variable_count = VARIABLES,
};

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .was_set = was_set,
    .update_outputs = update_outputs,
    .used_size = size_of_used,
};

static int lines;

static void count_lines(const vi_instance *instance, int level, const char *category, const char *text)
{
    (void)instance;
    CHECK(level == 3 && category != NULL && strlen(text) > 0, "level %d", level);
    lines += 1;
}

static vi_instance *started(void)
{
    vi_instance *instance = vi_instance_new("thing");
    CHECK(instance != NULL, "%s", "memory");
    instance->log = count_lines;
    instance->mode = VI_MODE_STEP;
    return instance;
}

static void random_references_and_sizes_are_errors_or_right(uint64_t *seed)
{
    vi_instance *instance = started();
    static double values[3000];
    for (int n = 0; n < 200000; ++n) {
        uint32_t references[3];
        const size_t count = choice(seed, 4);
        for (size_t i = 0; i < count; ++i) {
            references[i] = choice(seed, 20) == 0 ? (uint32_t)next_random(seed) : choice(seed, VARIABLES + 1);
        }
        const int type = (int)choice(seed, 3);
        const size_t room = choice(seed, 2) == 0 ? count : choice(seed, 3000);
        instance->mode = (vi_mode_of_use)(1 << choice(seed, 6));
        const int before = lines;
        bool good;
        if (type == VI_FLOAT64 && choice(seed, 2) == 0) {
            good = vi_instance_set(instance, "set", type, references, count, values, room, vi_write_doubles);
        } else if (type == VI_FLOAT64) {
            good = vi_instance_get(instance, "get", type, references, count, values, room, vi_read_doubles);
        } else {
            continue;
        }
        CHECK(lines == before + (good ? 0 : 1), "%d lines for one call", lines - before);
    }
    vi_instance_free(instance);
}

static void states_come_back_and_damaged_ones_do_not(uint64_t *seed)
{
    vi_instance *instance = started();
    thing *t = instance->self;
    void *saved = NULL;
    for (int n = 0; n < 20000; ++n) {
        t->used = choice(seed, 4) == 0 ? 1000 : choice(seed, 30);
        t->time = uniform(seed, -1.0, 1.0);
        for (int64_t row = 0; row < t->used; ++row) {
            t->rows[row] = t->time + (double)row;
        }
        if (choice(seed, 3) == 0) { /* otherwise the slot is reused */
            vi_state_free(&saved);
        }
        CHECK(vi_state_save(instance, "save", &saved), "%s", "save");
        size_t size = 0;
        CHECK(vi_state_size(instance, saved, &size), "%s", "size");
        unsigned char *bytes = malloc(size); /* of exactly this size, so that the sanitizer sees a byte too many */
        CHECK(bytes != NULL, "%s", "memory");
        CHECK(!vi_state_write(instance, saved, bytes, size - 1), "%s", "no room");
        CHECK(vi_state_write(instance, saved, bytes, size), "%s", "write");
        const double time = t->time;
        const int64_t used = t->used;
        t->time = 7.0;
        t->used = 0;
        void *back = NULL;
        CHECK(vi_state_read(instance, "read", bytes, size, &back), "%s", "read");
        CHECK(vi_state_restore(instance, "restore", back), "%s", "restore");
        CHECK(t->time == time && t->used == used, "%g, %lld", t->time, (long long)t->used);
        CHECK(used == 0 || t->rows[used - 1] == time + (double)(used - 1), "%s", "rows");
        vi_state_free(&back);
        const size_t place = (size_t)(next_random(seed) % size);
        bytes[place] = (unsigned char)(bytes[place] ^ (1u << choice(seed, 8)));
        CHECK(!vi_state_read(instance, "read", bytes, size, &back), "byte %lu changed", (unsigned long)place);
        CHECK(!vi_state_read(instance, "read", bytes, (size_t)(next_random(seed) % size), &back), "%s", "cut");
        for (size_t i = 0; i < size; ++i) {
            bytes[i] = (unsigned char)next_random(seed);
        }
        CHECK(!vi_state_read(instance, "read", bytes, size, &back), "%s", "noise");
        free(bytes);
    }
    CHECK(!vi_state_restore(instance, "restore", NULL), "%s", "no state");
    vi_state_free(&saved);
    vi_instance_free(instance);
}

static void bytes_come_back_from_their_packed_form(uint64_t *seed)
{
    for (int n = 0; n < 3000; ++n) {
        const size_t size = 1 + (size_t)(next_random(seed) % 2000);
        unsigned char *bytes = calloc(size, 1); /* of exactly the needed sizes, for the sanitizer */
        unsigned char *back = malloc(size);
        CHECK(bytes != NULL && back != NULL, "%s", "memory");
        const uint32_t numbers = choice(seed, 40);
        for (uint32_t i = 0; i < numbers; ++i) {
            bytes[next_random(seed) % size] = (unsigned char)next_random(seed);
        }
        const size_t packed_size = vi_sparse_pack(bytes, size, NULL, 0);
        unsigned char *packed = malloc(packed_size);
        CHECK(packed != NULL && packed_size <= size + size / 512 + 1, "%lu bytes", (unsigned long)packed_size);
        CHECK(vi_sparse_pack(bytes, size, packed, packed_size - 1) == packed_size, "%s", "too little room");
        CHECK(vi_sparse_pack(bytes, size, packed, packed_size) == packed_size, "%s", "just enough room");
        memset(back, 1, size);
        vi_sparse_unpack(packed, back, size);
        CHECK(memcmp(bytes, back, size) == 0, "%lu bytes", (unsigned long)size);
        CHECK(vi_sparse_fits(packed, packed_size, size), "%lu bytes", (unsigned long)packed_size);
        CHECK(!vi_sparse_fits(packed, packed_size + 1, size), "%s", "one byte more");
        CHECK(!vi_sparse_fits(packed, packed_size - 1, size), "%s", "one byte less");
        if (size >= 64) {
            packed[0] ^= 1u; /* another number of blocks */
            CHECK(!vi_sparse_fits(packed, packed_size, size), "%s", "another block");
        }
        free(bytes);
        free(back);
        free(packed);
    }
}

static void the_longest_message_fits(void)
{
    vi_instance *instance = vi_instance_new("a name that is not short at all, so that something must be cut off somewhere");
    CHECK(instance != NULL, "%s", "memory");
    instance->log = count_lines;
    ((thing *)instance->self)->parameter = -1.0;
    const int before = lines;
    CHECK(!vi_instance_initialize(instance, "initialize"), "%s", "a bad parameter");
    CHECK(lines == before + 1, "%d lines", lines - before);
    vi_instance_reset(instance);
    CHECK(vi_instance_initialize(instance, "initialize"), "%s", "good again");
    vi_instance_free(instance);
    vi_instance_free(NULL);
}

static void write_member(const char *folder, const char *name, const char *text)
{
    char path[VI_PATH_LENGTH];
    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    CHECK(file != NULL && fputs(text, file) >= 0 && fclose(file) == 0, "%s", path);
}

static void start_values_are_there_after_each_reset(const char *folder)
{
    write_member(folder, "starts.txt",
                 "1 4000000000000000\n4 1\n0 3ff0000000000000\n5 1\n77 1\n4294967295 7\n1 no number");
    vi_instance *instance = vi_instance_new("thing");
    CHECK(instance != NULL && vi_instance_describe(instance, "instantiate", folder, false), "%s", "memory");
    const thing *t = instance->self;
    for (int n = 0; n < 2; ++n) {
        CHECK(t->parameter == 2.0 && t->flag == 1, "%g, %d", t->parameter, (int)t->flag);
        CHECK(t->time == 0.0 && t->rows[0] == 0.0, "%g: what cannot be set has no start", t->time);
        CHECK(t->count == 5, "%d: was_set is called for each", (int)t->count);
        vi_instance_reset(instance);
    }
    vi_instance_free(instance);
}

static void any_start_values_do_no_harm(uint64_t *seed, const char *folder)
{
    static const char characters[] = "0123456789abcdefx- \n\n";
    for (int n = 0; n < 300; ++n) {
        char text[400];
        for (size_t i = 0; i + 1 < sizeof text; ++i) {
            text[i] = characters[choice(seed, sizeof characters - 1)];
        }
        text[sizeof text - 1] = '\0';
        write_member(folder, "starts.txt", text);
        vi_instance *instance = vi_instance_new("thing");
        CHECK(instance != NULL && vi_instance_describe(instance, "instantiate", folder, false), "%s", "memory");
        CHECK(instance->start_count <= VARIABLES, "%d", (int)instance->start_count);
        vi_instance_free(instance);
    }
}

static void set_size(void *field, void *values, size_t first, size_t count)
{
    memcpy(field, (int64_t *)values + first, count * sizeof(int64_t));
}

/* Set the size in each mode; returns the modes that take it. */
static int modes_that_take_a_size(vi_instance *instance)
{
    const uint32_t reference = SIZE;
    int modes = 0;
    for (int mode = 1; mode <= VI_MODE_CONFIGURATION; mode *= 2) {
        int64_t size = mode;
        instance->mode = (vi_mode_of_use)mode;
        const bool taken = vi_instance_set(instance, "set", VI_INT64, &reference, 1, &size, 1, set_size);
        CHECK(!taken || ((thing *)instance->self)->size == mode, "mode %d", mode);
        modes += taken ? mode : 0;
    }
    return modes;
}

static void a_size_is_set_before_initialization_where_it_is_structural(const char *folder)
{
    vi_instance *instance = started();
    CHECK(modes_that_take_a_size(instance) == VI_BEFORE_START, "%s", "a parameter");
    vi_instance_free(instance);
    write_member(folder, "sizes.txt", "structural 1\n");
    instance = vi_instance_new("thing");
    CHECK(vi_instance_describe(instance, "instantiate", folder, false) && instance->structural, "%s", "structural");
    CHECK(modes_that_take_a_size(instance) == (VI_MODE_INSTANTIATED | VI_MODE_CONFIGURATION), "%s", "structural");
    write_member(folder, "sizes.txt", "");
    vi_instance_free(instance);
}

static void described_references_are_places_in_the_list(const char *folder)
{
    write_member(folder, "references.txt", "3\n0\n999999999\n999\n1\n");
    vi_instance *instance = vi_instance_new("thing");
    instance->log = count_lines;
    CHECK(vi_instance_describe(instance, "instantiate", folder, true), "%s", "five references");
    CHECK(vi_instance_initialize(instance, "initialize"), "%s", "good");
    instance->mode = VI_MODE_INSTANTIATED;
    const double value = 7.5;
    const uint32_t parameter = 5;
    CHECK(vi_instance_set(instance, "set", VI_FLOAT64, &parameter, 1, &value, 1, vi_write_doubles), "%s", "the fifth");
    CHECK(((thing *)instance->self)->parameter == value, "%g", ((thing *)instance->self)->parameter);
    const uint32_t none[] = {0, 3, 4, 6, UINT32_MAX};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; ++i) {
        double got = 0.0;
        CHECK(!vi_instance_get(instance, "get", VI_FLOAT64, &none[i], 1, &got, 1, vi_read_doubles), "%lu",
              (unsigned long)none[i]);
    }
    vi_instance_free(instance);
}

static void any_references_do_no_harm(uint64_t *seed, const char *folder)
{
    static const char characters[] = "0123456789x- \n\n";
    for (int n = 0; n < 300; ++n) {
        char text[100];
        for (size_t i = 0; i + 1 < sizeof text; ++i) {
            text[i] = characters[choice(seed, sizeof characters - 1)];
        }
        text[sizeof text - 1] = '\0';
        write_member(folder, "references.txt", n > 0 ? text : "");
        vi_instance *instance = vi_instance_new("thing");
        instance->log = count_lines;
        const bool described = vi_instance_describe(instance, "instantiate", folder, true);
        CHECK(described == (instance->reference_count > 0)
                  && instance->reference_count <= VARIABLES + VI_MOST_SENSITIVITIES,
              "%s", text);
        for (uint32_t reference = 0; described && reference < 2 * VARIABLES; ++reference) {
            double got[8] = {0};
            (void)vi_instance_get(instance, "get", VI_FLOAT64, &reference, 1, got, 8, vi_read_doubles);
        }
        vi_instance_free(instance);
    }
}

int main(int count, char *arguments[])
{
    CHECK(count > 0, "%d", count);
    /* next to this program, in a folder of its own */
    char *folder = arguments[0];
    *strrchr(folder, '/') = '\0';
    uint64_t seed = 5;
    start_values_are_there_after_each_reset(folder);
    any_start_values_do_no_harm(&seed, folder);
    described_references_are_places_in_the_list(folder);
    any_references_do_no_harm(&seed, folder);
    a_size_is_set_before_initialization_where_it_is_structural(folder);
    random_references_and_sizes_are_errors_or_right(&seed);
    states_come_back_and_damaged_ones_do_not(&seed);
    bytes_come_back_from_their_packed_form(&seed);
    the_longest_message_fits();
    return 0;
}
