# Script (cmake -P): writes OUTPUT, C++ that defines NAME and NAMESize, from the text of INPUT.
file(READ "${INPUT}" text)
string(LENGTH "${text}" bytes)
# Literals have a limit, and those that follow each other are one.
file(WRITE "${OUTPUT}" "namespace ambilux {\nextern const char ${NAME}[];\nextern const unsigned long ${NAME}Size;\nconst char ${NAME}[] = R\"text(${text})text\";\nconst unsigned long ${NAME}Size = sizeof(${NAME}) - 1;\n}  // namespace ambilux\n")
