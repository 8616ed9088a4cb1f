/* The file of a structure's modes: read as written, and refused by one line when damaged. */
#define VI_SINES 15
#define VI_SIGNALS 8
#include "../../fmus/native/adapters/resources.c"
#include "../../fmus/native/structure/structure_file.c"

#include "check.h"

enum { FILES = 4000, LARGEST_CHANGE = 8 };

static unsigned char bytes[MOST_BYTES + LARGEST_CHANGE];

static void put_number(size_t place, uint64_t bits)
{
    for (int k = 0; k < NUMBER; ++k) {
        bytes[place + (size_t)k] = (unsigned char)(bits >> (8 * k));
    }
}

static uint64_t bits_of(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* Fill `bytes` with a file of random numbers; returns its length. */
static size_t make(uint64_t *seed, int modes, int contacts, int sines, int rows)
{
    const int signals = rows > 0 ? 1 : 0;
    const int count = modes * (VI_STRUCTURE_ROWS + modes + contacts + sines + signals) + 2 * rows;
    memcpy(bytes, MAGIC, LETTERS);
    put_number(LETTERS, (uint64_t)modes);
    put_number(LETTERS + NUMBER, (uint64_t)contacts);
    put_number(LETTERS + 2 * NUMBER, (uint64_t)sines);
    put_number(LETTERS + 3 * NUMBER, (uint64_t)signals);
    put_number(LETTERS + 4 * NUMBER, (uint64_t)rows);
    put_number(LETTERS + 5 * NUMBER, choice(seed, 2));
    for (int i = 0; i < count; ++i) {
        put_number(HEAD + (size_t)i * NUMBER, bits_of(uniform(seed, -1.0, 1.0)));
    }
    return HEAD + (size_t)count * NUMBER;
}

static vi_structure_file *opened(size_t length, char message[VI_MESSAGE_LENGTH])
{
    FILE *file = fopen("structure.bin", "wb");
    CHECK(file != NULL && fwrite(bytes, 1, length, file) == length && fclose(file) == 0, "%s", "no file written");
    message[0] = '\0';
    return vi_structure_file_open(".", message);
}

static void files_are_read_as_written(uint64_t *seed)
{
    static const int sizes[][4] = {
        {1, 0, 0, 0}, {1, 1, 0, 2}, {5, 3, 2, 0}, {VI_MODES, VI_PORTS, VI_SINES, VI_TABLE_ROOM}};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; ++i) {
        char message[VI_MESSAGE_LENGTH];
        const size_t length = make(seed, sizes[i][0], sizes[i][1], sizes[i][2], sizes[i][3]);
        vi_structure_file *file = opened(length, message);
        CHECK(file != NULL && message[0] == '\0', "%s", message);
        CHECK(file->modes == sizes[i][0] && file->contacts == sizes[i][1], "%d, %d", file->modes, file->contacts);
        CHECK(file->sines == sizes[i][2] && file->rows == sizes[i][3], "%d, %d", file->sines, file->rows);
        for (size_t k = 0; k < (length - HEAD) / NUMBER; ++k) {
            CHECK(bits_of(file->numbers[k]) == bits_at(bytes + HEAD + k * NUMBER), "number %zu", k);
        }
        free(file);
    }
}

static void without_a_file_there_are_no_modes(void)
{
    char message[VI_MESSAGE_LENGTH] = "";
    (void)remove("structure.bin");
    static const char *const folders[] = {NULL, ".", "no folder"};
    for (int i = 0; i < 3; ++i) {
        vi_structure_file *file = vi_structure_file_open(folders[i], message);
        CHECK(file != NULL && file->modes == 0 && message[0] == '\0', "%s", message);
        free(file);
    }
}

/* Damage a file: cut it, lengthen it, or change bytes of its head or of its numbers. Returns its new length. */
static size_t damaged(uint64_t *seed, size_t length)
{
    const unsigned kind = choice(seed, 4), more = choice(seed, LARGEST_CHANGE);
    if (kind == 0) {
        return choice(seed, (unsigned)length + 1u);
    }
    if (kind == 1) {
        return length + more;
    }
    for (unsigned n = 0; n <= more; ++n) {
        bytes[choice(seed, kind == 2 ? HEAD : (unsigned)length)] = (unsigned char)next_random(seed);
    }
    return length;
}

static void a_damaged_file_is_refused_by_one_line(uint64_t *seed)
{
    int refused = 0;
    for (int i = 0; i < FILES; ++i) {
        char message[VI_MESSAGE_LENGTH];
        const size_t whole = make(seed, 1 + (int)choice(seed, 5), (int)choice(seed, 4), (int)choice(seed, 3),
                                  3 * (int)choice(seed, 2));
        vi_structure_file *file = opened(damaged(seed, whole), message);
        if (file == NULL) {
            static const char start[] = "resources/structure.bin: expected ";
            CHECK(strncmp(message, start, sizeof start - 1) == 0 && strchr(message, '\n') == NULL, "%s", message);
            refused += 1;
            continue;
        }
        CHECK(message[0] == '\0' && file->modes >= 1 && file->modes <= VI_MODES && file->contacts >= 0
                  && file->contacts <= VI_PORTS && (file->coupled == 0 || file->coupled == 1), "file %d", i);
        for (int k = 0; k < VI_MOST_NUMBERS; ++k) {
            CHECK(isfinite(file->numbers[k]), "file %d: number %d", i, k);
        }
        free(file);
    }
    CHECK(refused > FILES / 4, "only %d of %d refused", refused, FILES);
}

int main(void)
{
    uint64_t seed = 51;
    without_a_file_there_are_no_modes();
    files_are_read_as_written(&seed);
    a_damaged_file_is_refused_by_one_line(&seed);
    return 0;
}
