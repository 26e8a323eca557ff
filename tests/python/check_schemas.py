"""Judges documents by JSON Schemas, with the package jsonschema.

    check_schemas.py FILE

FILE is JSON: "schemas" by name, and "documents" with "name", "schema", "document" and whether it "is_valid". Exits with a
message that lists every schema that is no schema and every document whose verdict differs.
"""

import json
import sys

from jsonschema import Draft202012Validator

with open(sys.argv[1], encoding="utf-8") as file:
    given = json.load(file)
validators = {}
for name, schema in given["schemas"].items():
    Draft202012Validator.check_schema(schema)
    validators[name] = Draft202012Validator(schema)
wrong = []
for document in given["documents"]:
    problems = list(validators[document["schema"]].iter_errors(document["document"]))
    if document["is_valid"] and problems:
        place = "/".join(str(part) for part in problems[0].absolute_path)
        wrong.append(f"{document['name']}: refused at {place}: {problems[0].message[:300]}")
    elif not document["is_valid"] and not problems:
        wrong.append(f"{document['name']}: accepted")
if wrong:
    sys.exit("\n".join([f"{len(wrong)} of {len(given['documents'])} verdicts differ:", *wrong[:40]]))
print(f"{len(given['documents'])} documents have the expected verdict")
